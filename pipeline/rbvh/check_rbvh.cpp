#include "pipeline/rbvh/check_rbvh.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "pipeline/rbvh/leaf_hierarchy.h"
#include "pipeline/rbvh/leaf_primitives.h"

namespace rbvh {
namespace {

using Fault = std::optional<std::string>;

std::string number(std::uint64_t n) { return std::to_string(n); }

bool is_coordinate(float value) { return std::abs(value) <= kLargestValue; }  // false for NaN

bool is_box(const float* lo, const float* hi) {
  for (int axis = 0; axis < 3; ++axis)
    if (!is_coordinate(lo[axis]) || !is_coordinate(hi[axis]) || !(lo[axis] <= hi[axis])) return false;
  return true;
}

bool is_box(const Bounds3f& b) { return is_box(&b.lo.x, &b.hi.x); }

bool is_invertible(const float* m) {
  Vec3d row[3];
  double size[3];
  for (std::size_t i = 0; i < 3; ++i) {
    row[i] = {m[4 * i], m[4 * i + 1], m[4 * i + 2]};
    size[i] = length(row[i]);
    if (!(size[i] >= 1 / kLargestValue && size[i] <= kLargestValue)) return false;
  }
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<std::size_t>((i + 1) % 3);
    if (!(std::abs(dot(row[i], row[k])) <= 1e-3 * size[i] * size[k])) return false;
  }
  return true;
}

Fault find_tree_fault(const Level& level) {
  const std::size_t nodes = level.nodes.size(), leaves = level.leaves.size();
  if (leaves == 0) return "has no leaf";
  if (nodes != 2 * leaves - 1)
    return "has " + number(nodes) + " nodes where " + number(leaves) + " leaves need " +
           number(2 * leaves - 1);
  std::vector<std::uint8_t> depth(nodes, 255), leaf_seen(leaves, 0);  // 255: no parent yet
  depth[0] = 0;
  for (std::size_t i = 0; i < nodes; ++i) {
    const RbvhNode& node = level.nodes[i];
    if (depth[i] == 255) return "node " + number(i) + " has no parent before it";
    if (!is_box(node.lo, node.hi)) return "node " + number(i) + " has a box that is inverted or not finite";
    if (node.count > 1)
      return "node " + number(i) + " has " + number(node.count) + " leaves; it may have one";
    if (node.count == 1) {
      if (node.first >= leaves)
        return "node " + number(i) + " names leaf " + number(node.first) + " of " + number(leaves);
      if (leaf_seen[node.first]++ != 0) return "leaf " + number(node.first) + " belongs to two nodes";
      continue;
    }
    if (node.first <= i || node.first >= nodes - 1)
      return "node " + number(i) + " names children " + number(node.first) + " and the next, of " +
             number(nodes) + " nodes; they must come after it";
    if (depth[i] >= kMaxLeafHierarchyDepth)
      return "node " + number(i) + " has children deeper than " + number(kMaxLeafHierarchyDepth);
    for (const std::size_t child : {std::size_t{node.first}, std::size_t{node.first} + 1}) {
      if (depth[child] != 255) return "node " + number(child) + " has two parents";
      depth[child] = static_cast<std::uint8_t>(depth[i] + 1);
    }
  }
  return {};
}

Fault find_tile_fault(const Level& level) {
  const std::uint32_t width = level.atlas_width, height = level.atlas_height;
  if (width < 2 || height < 2 || width > 65535 || height > 65535)
    return "has an atlas of " + number(width) + " x " + number(height) + " texels; 2 to 65535 are possible";
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  std::uint64_t texels = 0;
  for (std::size_t i = 0; i < level.leaves.size(); ++i) {
    const RbvhLeaf& leaf = level.leaves[i];
    const bool is_tile = firsts[i] == RBVH_NO_LEAF;
    if (leaf.width < 2 || leaf.height < 2)
      return "leaf " + number(i) + " has a tile of " + number(leaf.width) + " x " + number(leaf.height) +
             " texels; at least 2 are needed";
    if (std::uint64_t{leaf.width} * leaf.height > kMaxTileTexels)
      return "leaf " + number(i) + " has a tile of more than " + number(kMaxTileTexels) + " texels";
    if (is_tile &&
        (std::uint32_t{leaf.x} + leaf.width > width || std::uint32_t{leaf.y} + leaf.height > height))
      return "leaf " + number(i) + " has a tile that extends beyond the atlas";
    if (!std::all_of(leaf.to_tile, leaf.to_tile + 12, [](float v) { return std::isfinite(v); }))
      return "leaf " + number(i) + " has a map to its tile that is not finite";
    if (!is_invertible(leaf.to_tile))
      return "leaf " + number(i) + " has a map to its tile that cannot be inverted";
    if (is_tile) texels += std::uint64_t{leaf.width} * leaf.height;
  }
  if (texels > std::uint64_t{width} * height)
    return "has tiles that overlap: " + number(texels) + " texels in an atlas of " +
           number(std::uint64_t{width} * height);
  if (level.texels_used > texels)
    return "says that " + number(level.texels_used) + " of " + number(texels) + " texels are used";
  return {};
}

Fault find_primitive_fault(const Level& level) {
  const Scan& primitives = level.primitives;
  const std::size_t vertices = primitives.positions.size(), count = primitive_count(level);
  std::uint64_t next_leaf = 0, next_primitive = 0;
  for (const RbvhPrimitiveLeaf& leaf : level.primitive_leaves) {
    if (leaf.leaf >= level.leaves.size() || leaf.leaf < next_leaf)
      return "says that leaf " + number(leaf.leaf) + " of " + number(level.leaves.size()) +
             " has primitives, which is out of range or out of order";
    next_leaf = std::uint64_t{leaf.leaf} + 1;
    const std::uint32_t own = level.leaves[leaf.leaf].primitives;
    if (own == 0 || own > kMaxLeafPrimitives || leaf.first != next_primitive || next_primitive + own > count)
      return "leaf " + number(leaf.leaf) + " has " + number(own) + " primitives from number " +
             number(leaf.first) + " on, of " + number(count);
    next_primitive += own;
  }
  if (next_primitive != count)
    return "has " + number(count) + " primitives, and leaves that use " + number(next_primitive);
  if (primitives.normals.size() != vertices ||
      (!primitives.colors.empty() && primitives.colors.size() != vertices) ||
      (holds_discs(level) && (primitives.radii.size() != vertices || !primitives.triangles.empty())))
    return "has primitives of " + number(vertices) +
           " vertices, and other numbers of normals, colours or radii";
  for (std::size_t i = 0; i < vertices; ++i) {
    const Vec3f p = primitives.positions[i], n = primitives.normals[i];
    if (!is_coordinate(p.x) || !is_coordinate(p.y) || !is_coordinate(p.z))
      return "vertex " + number(i) + " has a coordinate that is not finite";
    const double size = length(static_cast<Vec3d>(n));
    if (!(std::abs(size - 1) < 1e-3 || (size == 0 && !holds_discs(level))))
      return "vertex " + number(i) + " has a normal that is not of length 1";
    if (holds_discs(level) && !(primitives.radii[i] >= 0 && is_coordinate(primitives.radii[i])))
      return "disc " + number(i) + " has a radius that is negative or not finite";
  }
  for (std::size_t i = 0; i < primitives.triangles.size(); ++i)
    for (const std::uint32_t vertex : primitives.triangles[i])
      if (vertex >= vertices)
        return "triangle " + number(i) + " names vertex " + number(vertex) + " of " + number(vertices);
  return {};
}

Fault find_layer_fault(const Level& level, const Layer& layer) {
  if (!std::isfinite(layer.lo) || !std::isfinite(layer.hi) || !(layer.lo <= layer.hi) ||
      !std::isfinite(layer.hi - layer.lo))
    return "has a range that is inverted or not finite";
  if (layer.tiles.empty()) return {};
  if (layer.tiles.size() != level.leaves.size())
    return "has " + number(layer.tiles.size()) + " tiles for " + number(level.leaves.size()) + " leaves";
  if (layer.width < 2 || layer.height < 2 || layer.width > 65535 || layer.height > 65535)
    return "has an atlas of " + number(layer.width) + " x " + number(layer.height) +
           " texels; 2 to 65535 are possible";
  std::uint64_t texels = 0;
  for (const LayerTile& tile : layer.tiles) {
    if (tile.width < 2 || tile.height < 2 || std::uint64_t{tile.width} * tile.height > kMaxTileTexels ||
        std::uint32_t{tile.x} + tile.width > layer.width ||
        std::uint32_t{tile.y} + tile.height > layer.height)
      return "has a tile that is too small or too large, or extends beyond its atlas";
    texels += std::uint64_t{tile.width} * tile.height;
  }
  if (texels > std::uint64_t{layer.width} * layer.height) return "has tiles that overlap";
  return {};
}

Fault find_level_fault(const Level& level) {
  for (const float value : {level.rho, level.alpha, level.phi_degrees, level.error})
    if (!std::isfinite(value)) return "has a parameter that is not finite";
  for (const Vec3f& origin : {level.grid.origin, level.lattice.origin})
    if (!is_box(&origin.x, &origin.x)) return "has a grid or lattice that is not finite";
  for (const float step : {level.grid.frame_step, level.grid.box_step, level.lattice.step})
    if (!(step >= 0) || !is_coordinate(step)) return "has a grid or lattice that is not finite";
  if ((level.grid.frame_step > 0) != (level.grid.box_step > 0)) return "has a grid for frames or boxes alone";
  if (!is_box(level.bounds)) return "has bounds that are inverted or not finite";
  if (level.layers.empty() || level.layers.size() > kMaxLayers)
    return "has " + number(level.layers.size()) + " layers; 1 to " + number(kMaxLayers) + " are possible";
  std::set<std::string> names;
  for (const Layer& layer : level.layers) {
    if (!is_name(layer.name) || !names.insert(layer.name).second)
      return "has a layer whose name is not letters, digits, _ and -, or is there twice";
    if (layer.channels < 1 || layer.channels > kMaxChannels)
      return "layer " + layer.name + " has " + number(layer.channels) + " channels; 1 to " +
             number(kMaxChannels) + " are possible";
  }
  if (layer_kind(level.layers[0].name) != LayerKind::kHeight || level.layers[0].channels != 1)
    return "does not begin with a layer height of one channel";
  for (const Layer& layer : level.layers)
    if (layer_kind(layer.name) != LayerKind::kUser && !layer.tiles.empty())
      return "layer " + layer.name + " does not have the level's atlas";
  for (const Layer& layer : level.layers)
    if (Fault fault = find_layer_fault(level, layer)) return "layer " + layer.name + " " + *fault;
  if (!level.derived_from.empty() && !is_name(level.derived_from))
    return "is derived from a level whose name is not letters, digits, _ and -";
  if (!(level.reached >= 0 && std::isfinite(level.reached))) return "has a reached error that is no number";
  if (level.fidelity.measured)
    for (const float value :
         {level.fidelity.mask_mismatch_percent, level.fidelity.median_dt, level.fidelity.p99_dt})
      if (!(value >= 0)) return "has a measured fidelity that is no number";
  if (const LevelMeasures& m = level.fidelity.more; m.views > 0) {
    for (const float value : {m.silhouette_percent, m.p999_dt, m.median_normal, m.p95_normal, m.image_rmse,
                              m.image_psnr, m.control_rmse, m.control_psnr, m.to_scan_rms, m.to_scan_max,
                              m.to_level_rms, m.to_level_max, m.texel})
      if (!(value >= 0)) return "has a measure that is no number";
    if (!(m.image_ssim >= -1 && m.image_ssim <= 1 && m.control_ssim >= -1 && m.control_ssim <= 1))
      return "has a measured similarity that is not between -1 and 1";
  }
  if (Fault fault = find_tree_fault(level)) return fault;
  if (Fault fault = find_primitive_fault(level)) return fault;
  if (Fault fault = find_tile_fault(level)) return fault;
  for (const Layer& layer : level.layers)
    if (layer_kind(layer.name) == LayerKind::kUser && layer.tiles.empty() && !level.primitive_leaves.empty())
      return "layer " + layer.name + " has no place for leaves of primitives";
  if (find_layer(level, "color") != nullptr &&
      level.primitives.colors.size() != level.primitives.positions.size())
    return "has colours, and primitives without colours";
  return {};
}

}  // namespace

// Names become parts of file names ({level}) and of subimage names.
bool is_name(const std::string& name) {
  return !name.empty() && name.size() <= 32 && std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  });
}

std::optional<std::string> find_fault(const Rbvh& rbvh) {
  const RbvhSource& source = rbvh.source;
  if (!std::isfinite(source.area) || source.area < 0 || !is_finite(source.shift) || !is_box(source.bounds))
    return "the source has an area, a shift or bounds that are not finite";
  if (rbvh.levels.empty() || rbvh.levels.size() > kMaxLevels)
    return "there are " + number(rbvh.levels.size()) + " levels; 1 to " + number(kMaxLevels) +
           " are possible";
  std::set<std::string> names;
  for (std::size_t i = 0; i < rbvh.levels.size(); ++i) {
    const Level& level = rbvh.levels[i];
    if (!is_name(level.name) || !names.insert(level.name).second)
      return "level number " + number(i) +
             " has a name that is not letters, digits, _ and -, or is there twice";
    if (const Fault fault = find_level_fault(level)) return "level " + level.name + ": " + *fault;
  }
  return {};
}

std::optional<std::string> find_texel_fault(const Rbvh& rbvh) {
  for (const Level& level : rbvh.levels)
    for (const Layer& layer : level.layers) {
      const auto [width, height] = atlas_size(level, layer);
      const std::uint64_t wanted = std::uint64_t{width} * height * layer.channels;
      if (layer.texels.size() != wanted)
        return "level " + level.name + ": layer " + layer.name + " has " + number(layer.texels.size()) +
               " values where its atlas needs " + number(wanted);
    }
  return {};
}

}  // namespace rbvh
