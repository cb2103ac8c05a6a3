#include "pipeline/rbvh/pack_atlas.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

/// Of an atlas, also of one without tiles: an image cannot be empty.
constexpr std::uint32_t kLeastSide = 2;

}  // namespace

AtlasSize pack_tiles(std::span<RbvhLeaf* const> tiles) {
  std::vector<RbvhLeaf*> order(tiles.begin(), tiles.end());
  std::uint64_t area = 0;
  std::uint32_t widest = 0;
  for (const RbvhLeaf* leaf : tiles) {
    area += static_cast<std::uint64_t>(leaf->width) * leaf->height;
    widest = std::max<std::uint32_t>(widest, leaf->width);
  }
  std::stable_sort(order.begin(), order.end(), [](const RbvhLeaf* p, const RbvhLeaf* q) {
    return p->height != q->height ? p->height > q->height : p->width > q->width;
  });
  AtlasSize size;
  size.width = std::max(widest, static_cast<std::uint32_t>(std::ceil(std::sqrt(static_cast<double>(area)))));
  size.width = std::max(kLeastSide, (size.width + 63) / 64 * 64);
  std::uint32_t x = 0, y = 0, shelf = 0;
  for (RbvhLeaf* const tile : order) {
    RbvhLeaf& leaf = *tile;
    if (x + leaf.width > size.width) {
      y += shelf;
      x = shelf = 0;
    }
    if (y + leaf.height > 65535 || size.width > 65535)
      throw Error(ErrorKind::kBudget, "",
                  "a level's atlas is over 65535 texels wide or high; a coarser level is wanted");
    leaf.x = static_cast<std::uint16_t>(x);
    leaf.y = static_cast<std::uint16_t>(y);
    x += leaf.width;
    shelf = std::max<std::uint32_t>(shelf, leaf.height);
  }
  size.height = std::max(kLeastSide, y + shelf);
  return size;
}

std::vector<std::uint16_t> assemble_layer(const std::vector<Tile>& tiles,
                                          const std::vector<std::uint16_t>& texels, AtlasSize size) {
  std::vector<std::uint16_t> atlas(static_cast<std::size_t>(size.width) * size.height);
  for (const Tile& t : tiles) {
    if (t.decision != LeafDecision::kRasterize) continue;
    for (std::size_t y = 0; y < t.leaf.height; ++y)
      std::copy_n(texels.begin() + static_cast<std::ptrdiff_t>(t.first_texel + y * t.leaf.width),
                  t.leaf.width,
                  atlas.begin() + static_cast<std::ptrdiff_t>((t.leaf.y + y) * size.width + t.leaf.x));
  }
  return atlas;
}

}  // namespace rbvh
