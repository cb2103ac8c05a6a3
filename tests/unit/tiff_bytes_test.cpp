// What the subimages of hand-made TIFF files take.
#include "io/tiff_bytes.h"

#include <gtest/gtest.h>

namespace rbvh {
namespace {

struct Maker {
  std::vector<std::byte> bytes;

  void put(std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i) bytes.push_back(static_cast<std::byte>(value >> (8 * i)));
  }
};

/// Two subimages: tiles of 7 bytes in the entry itself, and of 70000 and 5 bytes elsewhere.
std::vector<std::byte> classic() {
  Maker m;
  m.put(0x002a4949, 4);
  m.put(8, 4);
  m.put(2, 2);  // at 8
  m.put(256, 2), m.put(3, 2), m.put(1, 4), m.put(16, 4);
  m.put(325, 2), m.put(3, 2), m.put(1, 4), m.put(7, 4);
  m.put(38, 4);
  m.put(1, 2);  // at 38
  m.put(325, 2), m.put(4, 2), m.put(2, 4), m.put(56, 4);
  m.put(0, 4);
  m.put(70000, 4), m.put(5, 4);  // at 56
  return m.bytes;
}

TEST(TiffBytes, AreThoseOfEachSubimagesTiles) {
  EXPECT_EQ(tiff_subimage_bytes(classic()), (std::vector<std::uint64_t>{7, 70005}));
}

TEST(TiffBytes, BigTiffIsReadToo) {
  Maker m;
  m.put(0x002b4949, 4);
  m.put(8, 2), m.put(0, 2);
  m.put(16, 8);
  m.put(1, 8);  // at 16
  m.put(325, 2), m.put(16, 2), m.put(1, 8), m.put(5'000'000'000, 8);
  m.put(0, 8);
  EXPECT_EQ(tiff_subimage_bytes(m.bytes), (std::vector<std::uint64_t>{5'000'000'000}));
}

TEST(TiffBytes, TheListEndsWhereTheFileDoesNotHangTogether) {
  const std::vector<std::byte> whole = classic();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::vector<std::uint64_t> bytes = tiff_subimage_bytes(std::span(whole).first(size));
    EXPECT_EQ(bytes.size(), size < 32 ? 0u : 1u) << size;
  }
  std::vector<std::byte> looped = whole;
  looped[34] = std::byte{8};  // the first directory follows itself
  EXPECT_LE(tiff_subimage_bytes(looped).size(), 1024u);
  std::vector<std::byte> other = whole;
  other[0] = std::byte{'M'};
  EXPECT_TRUE(tiff_subimage_bytes(other).empty());
}

}  // namespace
}  // namespace rbvh
