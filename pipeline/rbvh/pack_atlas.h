// Packs a level's tiles into one rectangle of texels.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/rbvh/tile.h"

namespace rbvh {

struct AtlasSize {
  std::uint32_t width = 0, height = 0;
};

/// Places the leaves' tiles in shelves, tallest first (section 3.3 of the paper): sets x and y.
AtlasSize pack_tiles(std::span<RbvhLeaf* const> tiles);

/// The atlas of one signal, of the tiles that are rasterised; texels that belong to no tile are 0.
std::vector<std::uint16_t> assemble_layer(const std::vector<Tile>& tiles,
                                          const std::vector<std::uint16_t>& texels, AtlasSize size);

}  // namespace rbvh
