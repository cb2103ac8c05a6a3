// A layer's texels over a leaf's tile. Places (u, v) are in texels of the tile's heights, whatever the
// layer's own resolution.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "pipeline/rbvh/rbvh.h"
#include "pipeline/rbvh/texel.h"

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

/// A leaf's surface over its tile or, where it has none, over its primitives' frame.
class LeafSurface {
 public:
  /// `first`: its first primitive, or RBVH_NO_LEAF.
  LeafSurface(const Level& level, std::uint32_t leaf, std::uint32_t first);

  /// The surface's point over (u, v). Of a tile: bilinear in those of the four texels that have a height,
  /// or the height of the nearest texel within `radius` texels. Of primitives: their point over the nearest
  /// place, if that is within two texels or `radius`.
  std::optional<Vec3f> point(float u, float v, float radius) const;

 private:
  const Level& level_;
  const RbvhLeaf& leaf_;
  std::uint32_t first_;
  TileFrame frame_;
  std::vector<Vec3f> corners_;  ///< of the primitives, three each, in the frame
};

}  // namespace rbvh
