#include "pipeline/rbvh/level_mesh.h"

#include <algorithm>
#include <cmath>

#include "pipeline/rbvh/height_normals.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/level_surface.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/rbvh/trim_tiles.h"
#include "pipeline/scan/stitch.h"

namespace rbvh {
namespace {

/// A texel's disc extends past the middle between it and its diagonal neighbours.
constexpr double kDiscPerTexel = 0.75;
/// A surface that is inclined to the tile stretches its texels; at most by this factor.
constexpr double kMostStretch = 3;

/// Collects the vertices of one level's surface.
class Surface {
 public:
  Surface(const Level& level, bool is_cloud)
      : level_(level),
        normals_(find_layer(level, "normal")),
        colors_(find_layer(level, "color")),
        has_objects_(objects_of(level) != std::vector<std::uint32_t>{0} && keeps_objects(level, is_cloud)) {
    has_colors_ = colors_ != nullptr || !level.primitives.colors.empty();
  }

  Scan scan;

  /// A texel of the leaf's tile.
  std::uint32_t add_texel(const RbvhLeaf& leaf, const TileFrame& frame, std::uint32_t x, std::uint32_t y) {
    const std::size_t at = (std::size_t{leaf.y} + y) * level_.atlas_width + leaf.x + x;
    scan.positions.push_back(frame.at(x, y, level_.layers[0].texels[at]));
    scan.normals.push_back(normals_ != nullptr && normals_->texels[at] != 0
                               ? unpack_normal(normals_->texels[at])
                               : height_normal(level_, leaf, static_cast<int>(x), static_cast<int>(y)));
    if (has_colors_) {
      const Vec3f c = (colors_ != nullptr ? unpack_srgb(colors_->texels[at]) : Vec3f{1, 1, 1}) * 255.0f +
                      Vec3f{0.5f, 0.5f, 0.5f};
      scan.colors.push_back(
          {static_cast<std::uint8_t>(c.x), static_cast<std::uint8_t>(c.y), static_cast<std::uint8_t>(c.z)});
    }
    return static_cast<std::uint32_t>(scan.positions.size() - 1);
  }

  void add_primitives() {
    const Scan& from = level_.primitives;
    const auto first = static_cast<std::uint32_t>(scan.positions.size());
    scan.positions.insert(scan.positions.end(), from.positions.begin(), from.positions.end());
    scan.normals.insert(scan.normals.end(), from.normals.begin(), from.normals.end());
    scan.radii.insert(scan.radii.end(), from.radii.begin(), from.radii.end());
    if (has_colors_) {
      scan.colors.insert(scan.colors.end(), from.colors.begin(), from.colors.end());
      scan.colors.resize(scan.positions.size(), Color8{255, 255, 255});
    }
    for (const RbvhPrimitiveLeaf& leaf : level_.primitive_leaves)
      for (std::uint32_t i = leaf.first; i < leaf.first + level_.leaves[leaf.leaf].primitives; ++i) {
        add_object(leaf.leaf);
        if (holds_discs(level_)) continue;
        const Triangle& t = from.triangles[i];
        scan.triangles.push_back({first + t[0], first + t[1], first + t[2]});
      }
  }

  /// That of the next triangle or point.
  void add_object(std::uint32_t leaf) {
    if (has_objects_) scan.object_ids.push_back(static_cast<std::int32_t>(level_.leaves[leaf].object_id));
  }

 private:
  const Level& level_;
  const Layer* normals_;
  const Layer* colors_;
  bool has_objects_, has_colors_ = false;
};

void add_quads(const Level& level, Surface& surface, Patches& patches, LevelMeshCounts& counts) {
  TrimmedTiles trimmed = trim_tiles(level);
  patches.of_vertex.assign(trimmed.vertex_texels.size(), 0);
  patches.gap = std::move(trimmed.vertex_texels);
  constexpr std::uint32_t kNone = 0xffffffffu;
  std::vector<std::uint32_t> vertices;
  std::uint32_t current = kNone;
  for_each_quad(level, [&](std::uint32_t k, std::uint32_t x, std::uint32_t y, std::size_t texel) {
    ++counts.tile_quads;
    if (trimmed.quads[texel] == 0) {
      ++counts.trimmed_quads;
      return;
    }
    const RbvhLeaf& leaf = level.leaves[k];
    if (k != current) {
      current = k;
      vertices.assign(std::size_t{leaf.width} * leaf.height, kNone);
    }
    const TileFrame frame(leaf);
    const auto vertex = [&](std::uint32_t i, std::uint32_t j) {
      std::uint32_t& v = vertices[(y + j) * leaf.width + x + i];
      if (v == kNone) {
        v = surface.add_texel(leaf, frame, x + i, y + j);
        patches.of_vertex.push_back(k + 1);
        patches.gap.push_back(static_cast<float>(std::max(length(frame.u), length(frame.v))));
      }
      return v;
    };
    const std::uint32_t a = vertex(0, 0), b = vertex(1, 0), c = vertex(0, 1), d = vertex(1, 1);
    surface.scan.triangles.push_back({a, b, d});
    surface.scan.triangles.push_back({a, d, c});
  });
}

Scan mesh_of_level(const Level& level, LevelMeshCounts& counts) {
  Surface surface(level, false);
  Patches patches;
  surface.add_primitives();
  counts.primitive_triangles = surface.scan.triangles.size();
  counts.primitive_open_edges = count_edges(surface.scan).open;
  Scan& mesh = surface.scan;
  if (level.primitive_leaves.size() < level.leaves.size()) {
    add_quads(level, surface, patches, counts);
    const StitchCounts stitched = stitch(mesh, patches);
    counts.welded_vertices = stitched.welded_vertices;
    counts.stitch_triangles = stitched.added_triangles;
  }
  const EdgeCounts edges = count_edges(mesh);
  counts.open_edges = edges.open;
  counts.non_manifold_edges = edges.non_manifold;
  return std::move(mesh);
}

Scan cloud_of_level(const Level& level) {
  Surface surface(level, true);
  const std::vector<std::uint16_t>& heights = level.layers[0].texels;
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  for (const RbvhNode& node : level.nodes) {
    if (node.count == 0 || firsts[node.first] != RBVH_NO_LEAF) continue;
    const RbvhLeaf& leaf = level.leaves[node.first];
    const TileFrame frame(leaf);
    const Vec3d outside = normalized(frame.w);
    for (std::uint32_t y = 0; y < leaf.height; ++y)
      for (std::uint32_t x = 0; x < leaf.width; ++x) {
        const std::size_t at = (std::size_t{leaf.y} + y) * level.atlas_width + leaf.x + x;
        if (heights[at] == 0) continue;
        const Vec3f p = frame.at(x, y, heights[at]);
        bool is_inside = true;
        for (int axis = 0; axis < 3; ++axis)
          is_inside = is_inside && p[axis] >= node.lo[axis] && p[axis] <= node.hi[axis];
        if (!is_inside) continue;
        surface.add_texel(leaf, frame, x, y);
        surface.add_object(node.first);
        const double cosine = std::abs(dot(Vec3d(surface.scan.normals.back()), outside));
        surface.scan.radii.push_back(static_cast<float>(
            kDiscPerTexel * std::max(length(frame.u), length(frame.v)) / std::max(cosine, 1 / kMostStretch)));
      }
  }
  if (holds_discs(level)) surface.add_primitives();
  return std::move(surface.scan);
}

}  // namespace

std::vector<std::uint32_t> objects_of(const Level& level) {
  std::vector<std::uint32_t> ids;
  for (const RbvhLeaf& leaf : level.leaves) ids.push_back(leaf.object_id);
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

bool keeps_objects(const Level& level, bool is_cloud) {
  return is_cloud || level.primitive_leaves.size() == level.leaves.size() || objects_of(level).size() < 2;
}

Scan level_mesh(const Level& level, bool is_cloud, LevelMeshCounts* counts) {
  LevelMeshCounts unasked;
  LevelMeshCounts& all = counts != nullptr ? *counts : unasked;
  all = {};
  return is_cloud ? cloud_of_level(level) : mesh_of_level(level, all);
}

}  // namespace rbvh
