#include "pipeline/rbvh/level_surface.h"

#include <algorithm>
#include <cmath>

#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/rbvh/tile.h"

namespace rbvh {

void for_each_leaf_quad(
    const Level& level, const RbvhLeaf& leaf, const Bounds3f& box,
    const std::function<void(std::uint32_t x, std::uint32_t y, std::size_t texel)>& quad) {
  const std::vector<std::uint16_t>& heights = level.layers.at(0).texels;
  const TileFrame frame(leaf);
  const double limit = static_cast<double>(kStepLimitTexels) * length(frame.u) / length(frame.w);
  for (std::uint32_t y = 0; y + 1 < leaf.height; ++y)
    for (std::uint32_t x = 0; x + 1 < leaf.width; ++x) {
      const std::size_t at = (std::size_t{leaf.y} + y) * level.atlas_width + leaf.x + x;
      const int h[4] = {heights[at], heights[at + 1], heights[at + level.atlas_width],
                        heights[at + level.atlas_width + 1]};
      if (std::find(h, h + 4, 0) != h + 4) continue;
      const auto step = [&](int i, int j) { return std::abs(h[i] - h[j]); };
      if (std::max({step(0, 1), step(2, 3), step(0, 2), step(1, 3)}) > limit) continue;
      const Vec3f a = frame.at(x, y, h[0]), d = frame.at(x + 1, y + 1, h[3]);
      if (squared_distance(box, (a + d) * 0.5f) > 0) continue;
      quad(x, y, at);
    }
}

void for_each_quad(const Level& level, const std::function<void(std::uint32_t leaf, std::uint32_t x,
                                                                std::uint32_t y, std::size_t texel)>& quad) {
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  for (const RbvhNode& node : level.nodes) {
    if (node.count == 0 || firsts[node.first] != RBVH_NO_LEAF) continue;
    const Bounds3f box{{node.lo[0], node.lo[1], node.lo[2]}, {node.hi[0], node.hi[1], node.hi[2]}};
    for_each_leaf_quad(level, level.leaves[node.first], box,
                       [&](std::uint32_t x, std::uint32_t y, std::size_t at) { quad(node.first, x, y, at); });
  }
}

TriangleSoup surface_of(const Level& level) {
  TriangleSoup soup;
  const Scan& primitives = level.primitives;
  for (std::uint32_t i = 0; i < primitive_count(level); ++i) {
    if (holds_discs(level)) {
      add_disc(soup, primitives.positions[i], primitives.normals[i], primitives.radii[i]);
    } else {
      const Triangle& t = primitives.triangles[i];
      add_triangle(soup, primitives.positions[t[0]], primitives.positions[t[1]], primitives.positions[t[2]]);
    }
  }
  const std::vector<std::uint16_t>& heights = level.layers.at(0).texels;
  for_each_quad(level, [&](std::uint32_t leaf, std::uint32_t x, std::uint32_t y, std::size_t at) {
    const TileFrame frame(level.leaves[leaf]);
    const auto corner = [&](std::uint32_t i, std::uint32_t j) {
      return frame.at(x + i, y + j, heights[at + std::size_t{j} * level.atlas_width + i]);
    };
    add_triangle(soup, corner(0, 0), corner(1, 0), corner(1, 1));
    add_triangle(soup, corner(0, 0), corner(1, 1), corner(0, 1));
  });
  return soup;
}

}  // namespace rbvh
