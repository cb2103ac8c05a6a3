// A tile: the oriented rectangle of a leaf's primitives, rasterised into heights and further signals.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/rbvh/leaf_policy.h"
#include "rbvh/geometry.h"

namespace rbvh {

/// Neighbouring texels of a tile whose heights differ by more than this many texel sides are not connected.
inline constexpr float kStepLimitTexels = 8;

struct Tile {
  std::uint32_t node = 0;  ///< in the partition
  RbvhLeaf leaf{};         ///< all but its place in the atlas
  Bounds3f bounds;         ///< a ray is tested against the tile where it intersects these
  std::uint32_t texels_used = 0;
  std::size_t first_texel = 0;  ///< in TileTexels: row by row, width * height of them
  TileFlaws flaws;
  LeafDecision decision = LeafDecision::kSplit;  ///< only with kRasterize it has texels
  Vec3f w;                                       ///< its normal, towards the surface's outside
  float middle = 0;                              ///< along w: halfway between two layers, where it has any
  std::vector<std::uint32_t> uncovered;          ///< places among the references of uncovered triangles
};

/// The texels of many tiles, one after the other.
struct TileTexels {
  std::vector<std::uint16_t> heights, normals, colors;
};

}  // namespace rbvh
