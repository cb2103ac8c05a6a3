#include "pipeline/rbvh/height_normals.h"

#include <cmath>
#include <numbers>

#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/rbvh/tile.h"

namespace rbvh {
namespace {

float row_length(const float* row) { return length(Vec3f{row[0], row[1], row[2]}); }

}  // namespace

Vec3f height_normal(const Level& level, const RbvhLeaf& leaf, int x, int y) {
  const std::vector<std::uint16_t>& heights = level.layers[0].texels;
  const auto height = [&](int i, int j) {
    return static_cast<int>(heights[(leaf.y + static_cast<std::size_t>(j)) * level.atlas_width + leaf.x +
                                    static_cast<std::size_t>(i)]);
  };
  const float limit = kStepLimitTexels * row_length(leaf.to_tile + 8) / row_length(leaf.to_tile);
  const int here = height(x, y);
  const auto slope = [&](int dx, int dy) {
    float sum = 0, count = 0;
    for (const int side : {-1, 1}) {
      const int i = x + side * dx, j = y + side * dy;
      if (i < 0 || j < 0 || i >= leaf.width || j >= leaf.height) continue;
      const int there = height(i, j);
      const auto step = static_cast<float>((there - here) * side);
      if (there == 0 || std::abs(step) > limit) continue;
      sum += step;
      count += 1;
    }
    return count > 0 ? sum / count : 0;
  };
  const float along_u = slope(1, 0), along_v = slope(0, 1);
  const float* m = leaf.to_tile;
  // The gradient of w - h(u, v).
  return normalized(Vec3f{m[8] - m[0] * along_u - m[4] * along_v, m[9] - m[1] * along_u - m[5] * along_v,
                          m[10] - m[2] * along_u - m[6] * along_v});
}

namespace {

/// Calls for each texel of a tile that has a height: its place in the atlas, and the normal of its heights.
template <class Visit>
void for_each_normal(const Level& level, Visit&& visit) {
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  for (std::size_t k = 0; k < level.leaves.size(); ++k) {
    if (firsts[k] != RBVH_NO_LEAF) continue;
    const RbvhLeaf& leaf = level.leaves[k];
    for (int y = 0; y < leaf.height; ++y)
      for (int x = 0; x < leaf.width; ++x) {
        const std::size_t at =
            (leaf.y + static_cast<std::size_t>(y)) * level.atlas_width + leaf.x + static_cast<std::size_t>(x);
        if (level.layers[0].texels[at] != 0) visit(at, height_normal(level, leaf, x, y));
      }
  }
}

}  // namespace

Layer make_normal_layer(const Level& level) {
  Layer layer{"normal", 1, std::vector<std::uint16_t>(level.layers[0].texels.size())};
  for_each_normal(level, [&](std::size_t at, Vec3f normal) { layer.texels[at] = pack_normal(normal); });
  return layer;
}

double normals_apart(const Level& level, const Layer& normals, double degrees) {
  const auto cosine = static_cast<float>(std::cos(degrees * std::numbers::pi / 180));
  std::size_t texels = 0, apart = 0;
  for_each_normal(level, [&](std::size_t at, Vec3f normal) {
    if (normals.texels[at] == 0) return;
    ++texels;
    apart += dot(normal, unpack_normal(normals.texels[at])) < cosine;
  });
  return texels > 0 ? static_cast<double>(apart) / static_cast<double>(texels) : 0;
}

}  // namespace rbvh
