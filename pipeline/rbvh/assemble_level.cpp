#include "pipeline/rbvh/assemble_level.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "kernels/bvh/bvh_layout.h"
#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/rbvh/height_normals.h"
#include "pipeline/rbvh/leaf_hierarchy.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/leaf_rounding.h"
#include "pipeline/rbvh/pack_atlas.h"
#include "pipeline/rbvh/snap_primitives.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/scan/creases.h"
#include "pipeline/scan/vertex_normals.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 64;  // tiles
/// Where fewer texels have normals further from those of their heights, no normals are stored.
constexpr double kNormalsApartDegrees = 20, kMostApart = 0.1;

Vec3f center(const Scan& scan, std::uint32_t primitive) {
  if (scan.is_cloud()) return scan.positions[primitive];
  const Triangle& t = scan.triangles[primitive];
  return (scan.positions[t[0]] + scan.positions[t[1]] + scan.positions[t[2]]) * (1.0f / 3);
}

/// Orders a leaf's triangles so that each shares vertices with those before it: the file's codec needs few
/// bytes for them.
void sort_into_strips(std::vector<std::uint32_t>& primitives, const Scan& scan) {
  std::sort(primitives.begin(), primitives.end());  // their order depends on other levels' splits
  std::vector<unsigned int> indices, vertices;
  for (const std::uint32_t i : primitives)
    indices.insert(indices.end(), scan.triangles[i].begin(), scan.triangles[i].end());
  // With numbers from 0 on: the leaf's own vertices.
  vertices = indices;
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  for (unsigned int& index : indices)
    index = static_cast<unsigned int>(std::lower_bound(vertices.begin(), vertices.end(), index) -
                                      vertices.begin());
  using Corners = std::array<unsigned int, 3>;
  const auto corners = [](const std::vector<unsigned int>& of, std::size_t k) {
    return Corners{of[3 * k], of[3 * k + 1], of[3 * k + 2]};
  };
  std::vector<std::pair<Corners, std::uint32_t>> by_corners;
  for (std::size_t k = 0; k < primitives.size(); ++k)
    by_corners.push_back({corners(indices, k), primitives[k]});
  std::sort(by_corners.begin(), by_corners.end());
  std::vector<unsigned int> ordered(indices.size());
  meshopt_optimizeVertexCacheStrip(ordered.data(), indices.data(), indices.size(), vertices.size());
  constexpr std::uint32_t kTaken = 0xffffffffu;
  for (std::size_t k = 0; k < primitives.size(); ++k) {
    // Of equal triangles the last that is left.
    auto next = std::upper_bound(by_corners.begin(), by_corners.end(), corners(ordered, k),
                                 [](const Corners& a, const auto& b) { return a < b.first; });
    do --next;
    while (next->second == kTaken);
    primitives[k] = std::exchange(next->second, kTaken);
  }
}

constexpr std::size_t kDiscsTogether = 8;

/// Orders discs so that consecutive ones are close together, by halving along the longest axis.
void sort_into_blocks(std::span<std::uint32_t> primitives, const Scan& scan) {
  // By number first: their order depends on other levels' splits.
  std::sort(primitives.begin(), primitives.end());
  if (primitives.size() <= kDiscsTogether) return;
  Bounds3f box;
  for (const std::uint32_t i : primitives) box.add(center(scan, i));
  const Vec3f e = box.extent();
  const int axis = e.x >= e.y && e.x >= e.z ? 0 : e.y >= e.z ? 1 : 2;
  std::stable_sort(primitives.begin(), primitives.end(), [&](std::uint32_t a, std::uint32_t b) {
    return center(scan, a)[axis] < center(scan, b)[axis];
  });
  const std::size_t blocks = (primitives.size() + kDiscsTogether - 1) / kDiscsTogether,
                    middle = blocks / 2 * kDiscsTogether;
  sort_into_blocks(primitives.first(middle), scan);
  sort_into_blocks(primitives.subspan(middle), scan);
}

/// Appends the primitives of a leaf. `triangles`: the scan's, or those of its CreasedMesh.
void add_primitives(const Scan& scan, const std::vector<Triangle>& triangles,
                    std::span<const std::uint32_t> primitives, bool has_lattice, PrimitiveVertices& vertices,
                    Scan& to) {
  for (const std::uint32_t i : primitives) {
    if (scan.is_cloud()) {
      vertices.add(i);
      to.radii.push_back(has_lattice ? unround_radius(round_radius(scan.radii[i])) : scan.radii[i]);
      continue;
    }
    Triangle t = triangles[i];
    for (std::uint32_t& corner : t) corner = vertices.add(corner);
    to.triangles.push_back(t);
  }
}

/// Fills in the level's primitives and their leaves, whose tiles are `tiles[order[leaf]]`.
void store_primitives(Level& level, std::vector<Tile>& tiles, const std::vector<std::uint32_t>& order,
                      const std::vector<std::vector<std::uint32_t>>& of_tile, const Scan& scan,
                      std::span<const Vec3f> places, std::span<const std::uint32_t> first_at_place) {
  const auto holding = std::count_if(tiles.begin(), tiles.end(), [](const Tile& tile) {
    return tile.decision == LeafDecision::kPrimitives;
  });
  if (holding == 0) return;
  // Among tiles, whose normals are smooth, triangles are as small as texels.
  const bool in_sides = scan.normals.empty() && holding == std::ssize(tiles);
  const CreasedMesh creased = in_sides ? split_creases(scan) : CreasedMesh{scan.triangles, {}};
  const std::vector<Vec3f> normals = scan.normals.empty() ? vertex_normals(scan, creased) : scan.normals;
  PrimitiveVertices vertices(scan, normals, creased.copies, level.lattice, places, first_at_place,
                             level.primitives);
  for (std::uint32_t leaf = 0; leaf < order.size(); ++leaf) {
    Tile& tile = tiles[order[leaf]];
    if (tile.decision != LeafDecision::kPrimitives) continue;
    level.primitive_leaves.push_back({leaf, static_cast<std::uint32_t>(primitive_count(level))});
    tile.leaf.primitives = static_cast<std::uint32_t>(of_tile[order[leaf]].size());
    add_primitives(scan, creased.triangles, of_tile[order[leaf]], level.lattice.step > 0, vertices,
                   level.primitives);
  }
  if (scan.is_cloud()) return;
  rotate_as_stored(level.primitives);
  if (!(level.lattice.step > 0)) return;
  const std::vector<Vec3f> own = vertex_normals(level.primitives);
  for (std::size_t i = 0; i < own.size(); ++i)
    if (dot(own[i], level.primitives.normals[i]) >= kSameNormal) level.primitives.normals[i] = own[i];
}

}  // namespace

Level assemble_level(const LevelConfig& config, RefinedLevel& refined, const Scan& scan, float area,
                     const Lattice& lattice, const LeafGrid& grid) {
  const std::vector<Vec3f> places = snapped_positions(lattice, scan);
  std::vector<std::uint32_t> first_at_place;
  if (!scan.is_cloud()) first_at_place = find_first_at_place(refined, scan, places);
  // Where nothing is rounded, the scan's triangles stay as they are.
  if (!scan.is_cloud() && lattice.step > 0) drop_collapsed(refined, scan, first_at_place, lattice);
  std::vector<Tile>& tiles = refined.tiles;
  Level level;
  level.name = config.name;
  level.rho = config.rho;
  level.alpha = config.alpha;
  level.phi_degrees = config.phi_degrees;
  level.error = config.error;
  level.lattice = lattice;
  level.grid = grid;
  std::vector<RbvhLeaf*> rasterized;
  for (Tile& tile : tiles)
    if (tile.decision == LeafDecision::kRasterize) rasterized.push_back(&tile.leaf);
  const AtlasSize size = pack_tiles(rasterized);
  level.atlas_width = size.width;
  level.atlas_height = size.height;
  level.layers.push_back({"height", 1, assemble_layer(tiles, refined.texels.heights, size)});
  level.layers.push_back({"normal", 1, assemble_layer(tiles, refined.texels.normals, size)});
  if (!scan.colors.empty())
    level.layers.push_back({"color", 1, assemble_layer(tiles, refined.texels.colors, size)});

  std::vector<Bounds3f> boxes(tiles.size());
  parallel_for(tiles.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      if (tiles[k].decision == LeafDecision::kRasterize) {
        float* const frame = tiles[k].leaf.to_tile;
        if (grid.frame_step > 0) unround_frame(grid, round_frame(grid, frame), frame);
        boxes[k] = grid.box_step > 0 ? unround_box(grid, round_box(grid, tiles[k].bounds)) : tiles[k].bounds;
        continue;
      }
      if (scan.is_cloud())
        sort_into_blocks(refined.held[k], scan);
      else
        sort_into_strips(refined.held[k], scan);
      for (const std::uint32_t i : refined.held[k]) boxes[k].add(placed_bounds(places, scan, i));
    }
  });
  LeafHierarchy tree = build_leaf_hierarchy(boxes);
  store_primitives(level, tiles, tree.order, refined.held, scan, places, first_at_place);
  level.nodes = std::move(tree.nodes);
  for (const std::uint32_t k : tree.order) {
    level.leaves.push_back(tiles[k].leaf);
    level.bounds.add(boxes[k]);
    if (tiles[k].decision == LeafDecision::kRasterize) level.texels_used += tiles[k].texels_used;
  }
  parallel_for(level.primitive_leaves.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (const RbvhPrimitiveLeaf& leaf : std::span(level.primitive_leaves).subspan(begin, end - begin))
      fit_frame(level.primitives, leaf.first, primitive_texel(area, config.rho), level.leaves[leaf.leaf]);
  });
  if (config.error > 0 && normals_apart(level, level.layers[1], kNormalsApartDegrees) < kMostApart)
    level.layers.erase(level.layers.begin() + 1);
  return level;
}

}  // namespace rbvh
