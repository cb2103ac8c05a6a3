// Tiles: the oriented rectangle of a leaf's primitives, rasterised into heights and further signals on the
// device.
#pragma once

#include <functional>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/rbvh/partition.h"
#include "pipeline/rbvh/primitives.h"

namespace rbvh {

/// A finished tile. Texels row by row, width * height of them.
struct Tile {
  std::uint32_t node = 0;  ///< in the partition
  RbvhLeaf leaf{};         ///< all but its place in the atlas
  Bounds3f bounds;         ///< what a ray must touch to be tested against the tile
  std::uint32_t texels_used = 0;
  std::size_t first_texel = 0;  ///< in TileTexels
  bool is_exact = false;        ///< keeps its primitives
  bool is_final = false;        ///< else it has no texels yet, and is to be split
  bool is_faulty = false;       ///< two layers, steep area, a step or missed corners: better split
  bool has_back = false;        ///< part of it faces away: better split by facing, along w
  bool is_steep = false;        ///< part of it stands on the tile's plane: likewise
  Vec3f w;                      ///< the tile's outside, unit
  std::vector<std::uint32_t>
      uncovered;  ///< places among the references of triangles that no march finds in it
};

/// The texels of many tiles, one after the other.
struct TileTexels {
  std::vector<std::uint16_t> heights, normals, colors;
};

struct RasterConfig {
  bool boundary_apart = false;  ///< what touches the surface's rim is not in tiles
  float rho = 0;                ///< texels per unit of area, scan units: the paper's rho / total area
  float fill = 1.5f;        ///< the tile's rectangle is taken to be so much larger than what is covered of it
  float own_reach = 1.0f;   ///< texels past a primitive that it speaks for
  float reach = 1.5f;       ///< texels past a tile's primitives that its neighbours' may speak for
  float turn_reach = 1.2f;  ///< where they turn away: over a crest, say
  float open_reach = 0.6f;  ///< where nothing does: the surface ends there
  float boundary_reach = 0.45f;   ///< texels past a rim that is not in tiles that they may reach
  float layer_gap = 2;            ///< two coverings of a texel further apart (texels) are two layers
  float steep_limit = 4;          ///< area (texels) of what stands steep on the tile that is worth a split
  float miss_limit = 0.75f;       ///< corners further (texels) from the heights around them are worth a split
  float uncovered_slack = 0.02f;  ///< a triangle may reach so far (texels) into a cell with an empty corner
  float step_limit = 2;           ///< neighbours further apart in height (texels) than this are worth a split
};

/// Neighbouring texels of a tile whose heights differ by more than this many texel sides are not connected.
inline constexpr float kStepLimitTexels = 8;

/// The paper's R = sqrt(rho A^2 / A_projected): the side of a square tile in texels. Folded noise is not
/// allowed to inflate it without bound.
float tile_resolution(const PartitionNode& node, float rho);

/// Rasterises the given nodes. `is_final` is asked about each tile once its own primitives have shown its
/// faults (node, size, primitives, faults and w are known) and may mark it exact; final tiles are completed,
/// their texels appended. Returned: the final ones in the nodes' order, then the others.
std::vector<Tile> rasterize_tiles(const Primitives& primitives, const Partition& partition,
                                  const std::vector<std::uint32_t>& nodes, const RasterConfig& config,
                                  const std::function<bool(Tile&)>& is_final, TileTexels& texels);

}  // namespace rbvh
