// Hand-made TIFF files: strips, tiles, several subimages, other kinds of texels, and cut ones.
#include "io/tiff_file.h"

#include <gtest/gtest.h>

#include <array>
#include <numeric>

namespace rbvh {
namespace {

struct Maker {
  std::vector<std::byte> bytes;

  void put(std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i) bytes.push_back(static_cast<std::byte>(value >> (8 * i)));
  }
  void tag(std::uint64_t number, std::uint64_t type, std::uint64_t value, std::uint64_t count = 1) {
    put(number, 2), put(type, 2), put(count, 4), put(value, 4);
  }
};

struct Kind {
  std::uint32_t width = 3, height = 5, rows = 2;  // rows of a strip, or of a tile 16 wide
  bool tiled = false;
  std::uint32_t bits = 16, format = 1;
};

/// Uncompressed subimages, one after the other, named "a", "b" ...; texel i of each is i + 1.
std::vector<std::byte> make_tiff(const std::vector<Kind>& kinds, bool looped = false) {
  Maker m;
  m.put(0x002a4949, 4);
  m.put(8, 4);
  for (std::size_t n = 0; n < kinds.size(); ++n) {
    const Kind& k = kinds[n];
    const std::uint32_t pieces = (k.height + k.rows - 1) / k.rows, columns = k.tiled ? 16 : k.width;
    const std::size_t tags = k.tiled ? 12 : 11, lists = m.bytes.size() + 2 + 12 * tags + 4,
                      texels = lists + 8 * pieces;
    std::vector<std::uint32_t> at, sizes;
    for (std::uint32_t i = 0; i < pieces; ++i) {
      const std::uint32_t rows = k.tiled ? k.rows : std::min(k.rows, k.height - i * k.rows);
      at.push_back(static_cast<std::uint32_t>(texels) + i * k.rows * columns * 2);
      sizes.push_back(rows * columns * 2);
    }
    const std::uint64_t end = at.back() + sizes.back();
    m.put(tags, 2);
    m.tag(256, 4, k.width), m.tag(257, 4, k.height), m.tag(258, 3, k.bits), m.tag(259, 3, 1),
        m.tag(262, 3, 1);
    m.tag(270, 2, 'a' + n, 2);
    if (!k.tiled) m.tag(273, 4, lists, pieces), m.tag(277, 3, 1), m.tag(278, 4, k.rows);
    if (!k.tiled) m.tag(279, 4, lists + 4 * pieces, pieces);
    if (k.tiled) m.tag(277, 3, 1), m.tag(322, 4, columns), m.tag(323, 4, k.rows);
    if (k.tiled) m.tag(324, 4, lists, pieces), m.tag(325, 4, lists + 4 * pieces, pieces);
    m.tag(339, 3, k.format);
    m.put(n + 1 < kinds.size() ? end : looped ? 8 : 0, 4);
    for (const auto& list : {at, sizes})
      for (const std::uint32_t value : list) m.put(value, 4);
    for (std::uint32_t y = 0; m.bytes.size() < end; ++y)
      for (std::uint32_t x = 0; x < columns; ++x)
        m.put(x < k.width && y < k.height ? y * k.width + x + 1 : 0, 2);
  }
  return m.bytes;
}

std::vector<std::uint16_t> counting(std::size_t count) {
  std::vector<std::uint16_t> texels(count);
  std::iota(texels.begin(), texels.end(), std::uint16_t{1});
  return texels;
}

TEST(TiffFile, StripsAndTilesInTheirOrder) {
  const auto bytes = make_tiff({{}, {.height = 35, .rows = 16, .tiled = true}});
  TiffFile file(bytes);
  EXPECT_EQ(file.image().description, "a");
  EXPECT_EQ((std::array{file.image().width, file.image().height, file.image().channels}),
            (std::array{3u, 5u, 1u}));
  EXPECT_EQ(file.image().stored_bytes, 30u);
  EXPECT_EQ(file.decode(), counting(15));
  ASSERT_TRUE(file.next());
  EXPECT_EQ(file.image().description, "b");
  EXPECT_EQ(file.image().stored_bytes, 3u * 16 * 16 * 2);
  EXPECT_EQ(file.decode(), counting(105));
  EXPECT_FALSE(file.next());
}

TEST(TiffFile, OtherTexelsHaveNoChannels) {
  for (const Kind& kind : {Kind{.bits = 8}, Kind{.bits = 32}, Kind{.format = 2}, Kind{.format = 3}}) {
    const auto bytes = make_tiff({kind});
    EXPECT_EQ(TiffFile(bytes).image().channels, 0u) << kind.bits << " " << kind.format;
  }
}

TEST(TiffFile, CutAnywhereItIsRefusedAndALoopEnds) {
  const auto whole = make_tiff({{}, {.height = 35, .rows = 16, .tiled = true}});
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::vector<std::byte> cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_THROW(
        {
          TiffFile file(cut);
          if (file.image().channels == 1) static_cast<void>(file.decode());
          if (!file.next() || file.image().channels != 1) throw TiffFault("no second subimage");
          static_cast<void>(file.decode());
        },
        TiffFault)
        << size;
  }
  const auto looped = make_tiff({{}, {}}, true);
  TiffFile file(looped);
  int subimages = 1;
  while (subimages < 1000 && file.next()) ++subimages;
  EXPECT_EQ(subimages, 2);
}

}  // namespace
}  // namespace rbvh
