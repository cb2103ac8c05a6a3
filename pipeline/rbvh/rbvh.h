// The rasterized bounding volume hierarchy in host memory: what `build` makes, what the file pair holds.
// Novak & Dachsbacher, "Rasterized Bounding Volume Hierarchies", Eurographics 2012.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/layout.h"
#include "pipeline/base/vec.h"

namespace rbvh {

/// One signal over the level's atlas, row-major from the top left, channels interleaved.
/// "height": 1 channel, w of RbvhLeaf, 0: empty.
/// "normal": 1 channel, world-space unit normal, octahedral, 8 bits a coordinate (x low byte, y high byte).
/// "color": 1 channel, red 5 bits, green 6, blue 5 (from the top), sRGB.
struct Layer {
  std::string name;
  std::uint32_t channels = 1;
  std::vector<std::uint16_t> texels;  ///< atlas_width * atlas_height * channels
};

/// Measured against exact ray casting (pipeline/rbvh/fidelity.h); NaN: not measured.
struct LevelFidelity {
  float mask_mismatch_percent, median_dt, p99_dt;  ///< dt as a fraction of the bounding-box diagonal
  std::uint32_t holes, leaks, walls;               ///< worst view
  bool measured = false;
};

struct Level {
  std::string name;       ///< "Q0" .. "Q4"
  float rho = 0;          ///< texels for the whole surface, normalised to area 1
  float alpha = 0;        ///< least projected area over area
  float phi_degrees = 0;  ///< widest half-angle of the cone of normals
  Bounds3f bounds;        ///< of all tiles
  std::vector<RbvhNode> nodes;
  std::vector<RbvhLeaf> leaves;
  std::vector<RbvhExactLeaf> exact_leaves;  ///< those that keep their primitives, by leaf
  std::vector<RbvhPrimitive> exact_primitives;
  bool exact_discs = false;  ///< what those are; else triangles
  std::uint32_t atlas_width = 0, atlas_height = 0;
  std::vector<Layer> layers;      ///< height first
  std::uint64_t texels_used = 0;  ///< texels with a surface
  LevelFidelity fidelity{};
  std::uint64_t stored_bytes = 0;  ///< its share of the pair it was read from: nodes, leaves, layers
};

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
