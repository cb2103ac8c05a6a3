// LAS files of any version and point format.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "tests/scan_bytes.h"

namespace rbvh {

inline constexpr std::size_t kLasSizes[] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
inline constexpr std::size_t kLasColorAt[] = {0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};

struct LasPoint {
  std::int32_t x, y, z;
  std::uint16_t intensity = 0;
  std::uint8_t classification = 0;
  bool is_withheld = false;
  std::array<std::uint16_t, 3> color{};
};

struct LasFile {
  int minor = 2, format = 0;
  std::vector<LasPoint> points{};
  std::size_t extra_bytes = 0;
  std::string records{}, behind{};  ///< variable length records, and what follows the points
  std::uint32_t record_count = 0;
  std::optional<std::uint32_t> old_count{};
  std::optional<std::uint64_t> new_count{};

  bool is_wide() const { return format >= 6; }
  std::size_t header_size() const { return minor < 3 ? 227 : minor == 3 ? 235 : 375; }

  template <class T>
  static void put(std::string& bytes, std::size_t at, T value) {
    bytes.replace(at, sizeof(T), raw(value));
  }

  std::string point(const LasPoint& p) const {
    std::string bytes(kLasSizes[format] + extra_bytes, '\x55');  // what is not read is no zero
    put(bytes, 0, p.x);
    put(bytes, 4, p.y);
    put(bytes, 8, p.z);
    put(bytes, 12, p.intensity);
    if (is_wide()) {
      put(bytes, 15, static_cast<std::uint8_t>(p.is_withheld ? 0xff : 0xfb));
      put(bytes, 16, p.classification);
    } else {
      const int flags = p.is_withheld ? 0xe0 : minor > 0 ? 0x60 : 0;
      put(bytes, 15, static_cast<std::uint8_t>(p.classification | flags));
    }
    for (std::size_t c = 0; kLasColorAt[format] && c < 3; ++c)
      put(bytes, kLasColorAt[format] + 2 * c, p.color[c]);
    return bytes;
  }

  std::string bytes() const {
    std::string header(header_size(), '\0');
    header.replace(0, 4, "LASF");
    put(header, 24, std::uint8_t{1});
    put(header, 25, static_cast<std::uint8_t>(minor));
    put(header, 94, static_cast<std::uint16_t>(header_size()));
    put(header, 96, static_cast<std::uint32_t>(header_size() + records.size()));
    put(header, 100, record_count);
    put(header, 104, static_cast<std::uint8_t>(format));
    put(header, 105, static_cast<std::uint16_t>(kLasSizes[format] + extra_bytes));
    put(header, 107, old_count.value_or(is_wide() ? 0 : static_cast<std::uint32_t>(points.size())));
    for (const auto& [at, scale, offset] :
         {std::tuple{0u, 0.01, 500000.25}, {8u, 0.001, 5400000.5}, {16u, 0.5, -10.0}}) {
      put(header, 131 + at, scale);
      put(header, 155 + at, offset);
    }
    if (minor >= 4) put(header, 247, new_count.value_or(points.size()));
    std::string all = header + records;
    for (const LasPoint& p : points) all += point(p);
    return all + behind;
  }
};

}  // namespace rbvh
