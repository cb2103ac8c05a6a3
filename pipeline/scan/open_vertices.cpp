#include "pipeline/scan/open_vertices.h"

#include <cstdint>

namespace rbvh {

std::vector<bool> open_vertices(std::size_t count, const std::vector<Triangle>& triangles) {
  const auto mixed = [](std::uint64_t v) {
    v = (v + 1) * 0x9e3779b97f4a7c15u;
    return (v ^ (v >> 32)) * 0xd6e8feb86659fd93u;
  };
  std::vector<std::uint64_t> sums(count);
  for (const Triangle& t : triangles)
    for (std::size_t c = 0; c < 3; ++c) sums[t[c]] += mixed(t[(c + 1) % 3]) - mixed(t[(c + 2) % 3]);
  std::vector<bool> open(count);
  for (std::size_t v = 0; v < count; ++v) open[v] = sums[v] != 0;
  return open;
}

}  // namespace rbvh
