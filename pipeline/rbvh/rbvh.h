// The rasterized bounding volume hierarchy in host memory: what `build` makes, what the file pair holds.
// Novak & Dachsbacher, "Rasterized Bounding Volume Hierarchies", Eurographics 2012.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "kernels/common/layout.h"
#include "rbvh/geometry.h"
#include "rbvh/scan.h"

namespace rbvh {

/// Layers are told apart by name; those that are not standard are a user's own.
enum class LayerKind { kHeight, kNormal, kColor, kUser };
LayerKind layer_kind(std::string_view name);

/// Where a leaf's tile lies in a layer's own atlas.
struct LayerTile {
  std::uint16_t x = 0, y = 0;           ///< first texel
  std::uint16_t width = 0, height = 0;  ///< texels, each at least 2
};

/// One signal over the level's atlas, row-major from the top left, channels interleaved.
/// "height": 1 channel, w of RbvhLeaf, 0: empty.
/// "normal": 1 channel, world-space unit normal, octahedral, 8 bits a coordinate (x low byte, y high byte).
/// "color": 1 channel, red 5 bits, green 6, blue 5 (from the top), sRGB.
/// Any other: a user's values, 1..65535 evenly over [lo, hi], 0: no value.
struct Layer {
  std::string name;
  std::uint32_t channels = 1;
  std::vector<std::uint16_t> texels;  ///< width * height * channels of its atlas
  float lo = 0, hi = 0;               ///< equal: the level's own layers, or values as they are stored
  /// A layer of another resolution than the heights has an atlas of its own, with a tile for each leaf: its
  /// corner texels lie where those of the leaf's tile do. None: the level's atlas.
  std::uint32_t width = 0, height = 0;
  std::vector<LayerTile> tiles{};
  std::uint64_t stored_bytes = 0;  ///< in the atlas file it was read from: its compressed texels
};

/// What a level's hierarchy takes in the file that it was read from, by what it is for.
struct StreamBytes {
  std::uint64_t tree = 0, leaves = 0;
  std::uint64_t positions = 0, normals = 0, colors = 0, radii = 0, triangles = 0;  ///< of the primitives
};

/// Further measures over all views (format 1.2). dt and surface distances are fractions of the scan's
/// diagonal. `control`: the exact tracer against itself with rays elsewhere in its pixels.
struct LevelMeasures {
  float silhouette_percent = 0;                          ///< of the mask's mismatches, within 1 pixel of it
  float p999_dt = 0;                                     ///< beside LevelFidelity's median and p99
  float median_normal = 0, p95_normal = 0;               ///< degrees
  float image_rmse = 0, image_psnr = 0, image_ssim = 0;  ///< psnr may be +infinity
  float control_rmse = 0, control_psnr = 0, control_ssim = 0;
  float to_scan_rms = 0, to_scan_max = 0;    ///< from the level's surface to the scan's
  float to_level_rms = 0, to_level_max = 0;  ///< from the scan's surface to the level's
  float texel = 0;                           ///< mean side
  std::uint32_t views = 0, resolution = 0;   ///< how it was measured; no views: it was not
};

/// Measured against exact ray casting (pipeline/measure/fidelity.h).
struct LevelFidelity {
  float mask_mismatch_percent, median_dt, p99_dt;  ///< dt as a fraction of the bounding-box diagonal
  std::uint32_t holes, leaks, walls;               ///< worst view
  bool measured = false;
  LevelMeasures more{};
};

/// The larger of the two surface distances' RMS, in % of the diagonal: what a level is chosen by. NaN where
/// it was not measured.
double error_percent(const LevelFidelity& fidelity);

/// Points at equal distances along each axis.
struct Lattice {
  Vec3f origin{};
  float step = 0;  ///< scan units
};

/// What the frames and boxes of a level's leaves are rounded to: points origin + k * step, k whole.
struct LeafGrid {
  Vec3f origin{};
  float frame_step = 0;  ///< of the frames' corners, scan units; 0: any floats
  float box_step = 0;    ///< of the boxes
};

struct Level {
  std::string name;       ///< "Q0" .. "Q4"
  float rho = 0;          ///< texels for the whole surface, normalised to area 1
  float alpha = 0;        ///< least projected area over area
  float phi_degrees = 0;  ///< widest half-angle of the cone of normals
  float error = 0;        ///< that was asked for, of the scan's diagonal; 0: the density alone decided
  /// Of the scan's diagonal, as build found it by sampled_error(); of a derived level the sum of the errors
  /// that led to it. 0: its construction keeps the error, or there is none.
  float reached = 0;
  Bounds3f bounds;  ///< of all tiles
  std::vector<RbvhNode> nodes;
  std::vector<RbvhLeaf> leaves;
  std::vector<RbvhPrimitiveLeaf>
      primitive_leaves;  ///< those that hold primitives in place of a tile, by leaf
  /// Theirs, leaf by leaf: triangles with shared vertices, or points as discs. With normals and, where the
  /// scan has them, colours.
  Scan primitives;
  /// The primitives' positions are lattice.origin + k * lattice.step, k whole; step 0: any floats.
  Lattice lattice;
  LeafGrid grid;
  std::uint32_t atlas_width = 0, atlas_height = 0;
  std::vector<Layer> layers;      ///< height first
  std::uint64_t texels_used = 0;  ///< texels with a surface
  LevelFidelity fidelity{};
  std::string derived_from;        ///< the level from whose surface it was built; empty: the scan's
  std::uint64_t stored_bytes = 0;  ///< its share of the pair it was read from: nodes, leaves, layers
  StreamBytes streams;             ///< of that
};

/// The layer of that name, or nullptr.
const Layer* find_layer(const Level& level, std::string_view name);

/// The level's mean texel side in scan units.
double texel_side(const Level& level);

/// Width and height of the atlas that holds the layer's texels.
inline std::array<std::uint32_t, 2> atlas_size(const Level& level, const Layer& layer) {
  if (layer.tiles.empty()) return {level.atlas_width, level.atlas_height};
  return {layer.width, layer.height};
}

/// Where the leaf's tile lies in it.
inline LayerTile layer_tile(const Level& level, const Layer& layer, std::size_t leaf) {
  if (!layer.tiles.empty()) return layer.tiles[leaf];
  const RbvhLeaf& tile = level.leaves[leaf];
  return {tile.x, tile.y, tile.width, tile.height};
}

/// The scan a pair was built from.
struct RbvhSource {
  std::string name;  ///< file name without folders
  std::uint64_t hash = 0;
  std::uint64_t vertices = 0, triangles = 0;  ///< triangles == 0: a cloud
  double area = 0;                            ///< scan units squared
  Vec3d shift{};
  std::string units = "unknown";
  Bounds3f bounds;
};

struct Rbvh {
  RbvhSource source;
  std::string build_options;  ///< the options that shaped it, as JSON
  std::vector<Level> levels;  ///< finest first

  /// The level of that name, the finest for an empty name, or nullptr.
  const Level* find_level(const std::string& name) const;
};

}  // namespace rbvh
