#include "pipeline/rbvh/atlas.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "pipeline/base/error.h"

namespace rbvh {

AtlasSize pack_tiles(std::vector<Tile>& tiles) {
  std::vector<std::uint32_t> order(tiles.size());
  std::iota(order.begin(), order.end(), 0u);
  std::uint64_t area = 0;
  std::uint32_t widest = 0;
  for (const Tile& t : tiles) {
    area += static_cast<std::uint64_t>(t.leaf.width) * t.leaf.height;
    widest = std::max<std::uint32_t>(widest, t.leaf.width);
  }
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const RbvhLeaf &p = tiles[a].leaf, &q = tiles[b].leaf;
    return p.height != q.height ? p.height > q.height : p.width > q.width;
  });
  AtlasSize size;
  size.width = std::max(widest, static_cast<std::uint32_t>(std::ceil(std::sqrt(static_cast<double>(area)))));
  size.width = (size.width + 63) / 64 * 64;
  std::uint32_t x = 0, y = 0, shelf = 0;
  for (const std::uint32_t k : order) {
    RbvhLeaf& leaf = tiles[k].leaf;
    if (x + leaf.width > size.width) {
      y += shelf;
      x = shelf = 0;
    }
    if (y + leaf.height > 65535 || size.width > 65535)
      throw Error(ErrorKind::kBudget, "", "a level's atlas is over 65535 texels wide or high; lower rho");
    leaf.x = static_cast<std::uint16_t>(x);
    leaf.y = static_cast<std::uint16_t>(y);
    x += leaf.width;
    shelf = std::max<std::uint32_t>(shelf, leaf.height);
  }
  size.height = y + shelf;
  return size;
}

std::vector<std::uint16_t> assemble_layer(const std::vector<Tile>& tiles,
                                          const std::vector<std::uint16_t>& texels, AtlasSize size) {
  std::vector<std::uint16_t> atlas(static_cast<std::size_t>(size.width) * size.height);
  for (const Tile& t : tiles)
    for (std::size_t y = 0; y < t.leaf.height; ++y)
      std::copy_n(texels.begin() + static_cast<std::ptrdiff_t>(t.first_texel + y * t.leaf.width),
                  t.leaf.width,
                  atlas.begin() + static_cast<std::ptrdiff_t>((t.leaf.y + y) * size.width + t.leaf.x));
  return atlas;
}

}  // namespace rbvh
