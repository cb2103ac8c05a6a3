// A layer's texels over a leaf's tile. Places (u, v) are in texels of the tile's heights, whatever the
// layer's own resolution.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// Four texels of a layer (pixels of its atlas) and their bilinear weights.
struct TexelQuad {
  std::array<std::size_t, 4> texels{};
  std::array<float, 4> weights{};
};

struct LayerGrid {
  LayerTile tile;
  std::size_t row = 0;         ///< texels in a row of the layer's atlas
  float per_u = 1, per_v = 1;  ///< its texels to one of the heights'

  LayerGrid(const Level& level, const Layer& layer, std::uint32_t leaf);

  /// Of the tile's texel (x, y).
  std::size_t texel(int x, int y) const {
    return (tile.y + static_cast<std::size_t>(y)) * row + tile.x + static_cast<std::size_t>(x);
  }
  /// (u, v) in the layer's own texels, inside the tile.
  std::array<float, 2> place(float u, float v) const;
  TexelQuad quad(float u, float v) const;
};

/// The tile's height, bilinear in those of the four texels that have one; NaN: none has.
float height_at(const Level& level, const RbvhLeaf& leaf, float u, float v);

/// The height of the nearest texel within `radius` texels that has one; NaN: none has.
float nearest_height(const Level& level, const RbvhLeaf& leaf, float u, float v, float radius);

}  // namespace rbvh
