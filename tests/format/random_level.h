// Levels as builds make them, out of random tiles and primitives, without a device.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "pipeline/rbvh/leaf_hierarchy.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/leaf_rounding.h"
#include "pipeline/rbvh/rbvh.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/scan/vertex_normals.h"
#include "tests/exact_scenes.h"
#include "tests/format/pair_bytes.h"

namespace rbvh {

struct RandomLevelConfig {
  std::uint32_t leaves = 20;
  double primitive_share = 0.5;  ///< of the leaves
  bool discs = false, colors = false;
  bool on_grid = true;     ///< frames and boxes
  bool on_lattice = true;  ///< positions
};

/// With axes along three random directions at right angles.
inline RbvhLeaf random_tile(Random& random, const LeafGrid& grid, bool is_left_handed) {
  const auto direction = [&] { return static_cast<Vec3d>(uniform_direction(random)); };
  const Vec3d u = direction(), v = normalized(cross(u, direction())),
              w = cross(u, v) * (is_left_handed ? -1.0 : 1.0);
  const double side = round_texel(std::exp(static_cast<double>(uniform(random, -8, 2))));
  const Vec3d rows[3] = {u * (1 / side), v * (1 / side), w * (256 / side)};
  RbvhLeaf leaf{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (int axis = 0; axis < 3; ++axis)
      leaf.to_tile[4 * i + static_cast<std::size_t>(axis)] = static_cast<float>(rows[i][axis]);
    leaf.to_tile[4 * i + 3] = static_cast<float>(-dot(rows[i], static_cast<Vec3d>(uniform_point(random, 1))));
  }
  if (grid.frame_step > 0) unround_frame(grid, round_frame(grid, leaf.to_tile), leaf.to_tile);
  return leaf;
}

/// Appends `count` primitives near `center`: triangles that share vertices, or discs.
inline void add_random_primitives(Random& random, const RandomLevelConfig& config, const Lattice& lattice,
                                  Vec3f center, std::uint32_t count, Scan& to) {
  const auto add_vertex = [&] {
    to.positions.push_back(snapped(lattice, center + uniform_point(random, 0.1f)));
    to.normals.push_back(unpack_normal(pack_normal(uniform_direction(random))));
    if (config.discs) to.radii.push_back(unround_radius(round_radius(uniform(random, 0, 0.1f))));
    if (config.colors) {
      const auto byte = [&] { return static_cast<std::uint8_t>(random()); };
      to.colors.push_back({byte(), byte(), byte()});
    }
    return static_cast<std::uint32_t>(to.positions.size() - 1);
  };
  for (std::uint32_t i = 0; i < count; ++i) {
    if (config.discs) {
      add_vertex();
      continue;
    }
    // Across a side of the triangle before, or alone; sometimes a vertex of another leaf.
    Triangle t{};
    if (i > 0 && random() % 4 != 0) {
      const Triangle before = to.triangles.back();
      t = {before[2], before[1], add_vertex()};
    } else {
      for (std::uint32_t& corner : t) corner = add_vertex();
      if (random() % 4 == 0) t[0] = static_cast<std::uint32_t>(random() % to.positions.size());
    }
    std::rotate(t.begin(), t.begin() + random() % 3, t.end());
    to.triangles.push_back(t);
  }
}

/// Its layer "height" alone. `area`: of the source.
inline Level random_level(Random& random, const RandomLevelConfig& config, double area) {
  Level level;
  level.name = "Q0";
  level.rho = 1000;
  level.alpha = 0.85f;
  level.phi_degrees = 45;
  level.error = 0.01f;
  level.reached = 0.02f;
  level.bounds = {{-2, -2, -2}, {2, 2, 2}};
  if (config.on_grid) level.grid = leaf_grid(level.bounds);
  if (config.on_lattice) level.lattice = {level.bounds.lo, 4.0f / 65536};
  std::vector<Bounds3f> places(config.leaves);
  for (Bounds3f& place : places) {
    place.lo = uniform_point(random, 1);
    place.hi = place.lo + uniform_point(random, 0.1f) + Vec3f{0.1f, 0.1f, 0.1f};
    if (config.on_grid) place = unround_box(level.grid, round_box(level.grid, place));
  }
  const LeafHierarchy order = build_leaf_hierarchy(places);
  std::vector<Bounds3f> boxes;
  std::uint16_t y = 0;
  for (std::uint32_t i = 0; i < config.leaves; ++i) {
    Bounds3f box = places[order.order[i]];
    RbvhLeaf leaf = random_tile(random, level.grid, random() % 2 == 0);
    leaf.object_id = static_cast<std::uint32_t>(random() % 3);
    leaf.primitives = static_cast<std::uint32_t>(1 + random() % 20);
    if (uniform(random, 0, 1) < config.primitive_share) {
      const auto first = static_cast<std::uint32_t>(primitive_count(level));
      level.primitive_leaves.push_back({i, first});
      add_random_primitives(random, config, level.lattice, box.center(), leaf.primitives, level.primitives);
      fit_frame(level.primitives, first, primitive_texel(area, level.rho), leaf);
      box = {};
      for (std::uint32_t k = 0; k < leaf.primitives; ++k)
        box.add(primitive_bounds(level.primitives, first + k));
    } else {
      leaf.width = static_cast<std::uint16_t>(2 + random() % 30);
      leaf.height = static_cast<std::uint16_t>(2 + random() % 5);
      leaf.y = y;
      y = static_cast<std::uint16_t>(y + leaf.height);
    }
    boxes.push_back(box);
    level.leaves.push_back(leaf);
  }
  if (!config.discs) {
    // As a build does, which stores normals only where they differ from the triangles'.
    rotate_as_stored(level.primitives);
    const std::vector<Vec3f> own = vertex_normals(level.primitives);
    for (std::size_t i = 0; i < own.size(); i += 2) level.primitives.normals[i] = own[i];
    for (const RbvhPrimitiveLeaf& leaf : level.primitive_leaves)
      fit_frame(level.primitives, leaf.first, primitive_texel(area, level.rho), level.leaves[leaf.leaf]);
  }
  level.nodes = order.nodes;  // with the boxes of what the leaves hold
  for (std::size_t i = level.nodes.size(); i-- > 0;) {
    RbvhNode& node = level.nodes[i];
    Bounds3f box;
    if (node.count == 1) {
      box = boxes[node.first];
    } else {
      for (const std::uint32_t child : {node.first, node.first + 1}) {
        const RbvhNode& c = level.nodes[child];
        box.add(Bounds3f{{c.lo[0], c.lo[1], c.lo[2]}, {c.hi[0], c.hi[1], c.hi[2]}});
      }
    }
    std::copy_n(&box.lo.x, 3, node.lo);
    std::copy_n(&box.hi.x, 3, node.hi);
  }
  level.atlas_width = 32;
  level.atlas_height = std::max<std::uint32_t>(y, 2);
  level.layers.push_back(
      {"height", 1, std::vector<std::uint16_t>(level.atlas_width * level.atlas_height, 7)});
  if (config.colors)
    level.layers.push_back({"color", 1, std::vector<std::uint16_t>(level.layers[0].texels.size(), 9)});
  return level;
}

/// A pair of that level.
inline Rbvh random_pair(Random& random, const RandomLevelConfig& config) {
  Rbvh rbvh;
  rbvh.source = {"random.ply", 1, 2, 3, 3.5, {}, "metre", {{-2, -2, -2}, {2, 2, 2}}};
  rbvh.build_options = "{}";
  rbvh.levels.push_back(random_level(random, config, rbvh.source.area));
  return rbvh;
}

// The last two of the small pair's three leaves hold primitives, 2 and 1.
inline Rbvh make_rbvh_of_discs() {
  Rbvh rbvh = make_small_rbvh();
  Level& level = rbvh.levels[0];
  level.leaves[1].primitives = 2;
  level.leaves[2].primitives = 1;
  level.primitive_leaves = {{1, 0}, {2, 2}};
  level.primitives.positions = {{0, 0, 0}, {1, 0, 0}, {0.5f, 0, 0}};
  level.primitives.radii = {1, 0.5f, 0};
  level.primitives.normals = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}};
  level.primitives.colors = {{255, 0, 0}, {0, 255, 0}, {1, 2, 3}};
  level.texels_used = 9;
  return rbvh;
}

// Frames of either hand, boxes and positions on their grids, as builds make them.
inline Rbvh make_built_rbvh(bool discs) {
  Random random(7);
  return random_pair(random, {.discs = discs, .colors = true});
}

}  // namespace rbvh
