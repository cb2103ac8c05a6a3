#include "pipeline/rbvh/layer_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/rbvh/leaf_primitives.h"

namespace rbvh {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
/// Texels of a frame of primitives this far beside them still count: reads at their edge use all four.
constexpr float kReachTexels = 2;

float stored_height(const Level& level, const RbvhLeaf& leaf, int x, int y) {
  return level.layers[0].texels[(leaf.y + static_cast<std::size_t>(y)) * level.atlas_width + leaf.x +
                                static_cast<std::size_t>(x)];
}

/// The tile's height, bilinear in those of the four texels that have one; NaN: none has.
float height_at(const Level& level, const RbvhLeaf& leaf, float u, float v) {
  const int x = std::clamp(static_cast<int>(u), 0, leaf.width - 2),
            y = std::clamp(static_cast<int>(v), 0, leaf.height - 2);
  const float fu = u - static_cast<float>(x), fv = v - static_cast<float>(y);
  const float weights[4] = {(1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv};
  float sum = 0, weight = 0;
  for (int k = 0; k < 4; ++k) {
    const float h = stored_height(level, leaf, x + k % 2, y + k / 2);
    if (h == 0 || weights[k] <= 1e-6f) continue;
    sum += h * weights[k];
    weight += weights[k];
  }
  return weight > 0 ? sum / weight : kNone;
}

/// The height of the nearest texel within `radius` texels that has one; NaN: none has.
float nearest_height(const Level& level, const RbvhLeaf& leaf, float u, float v, float radius) {
  float best = radius * radius, found = kNone;
  const int x1 = std::min(leaf.width - 1, static_cast<int>(u + radius)),
            y1 = std::min(leaf.height - 1, static_cast<int>(v + radius));
  for (int y = std::max(0, static_cast<int>(v - radius)); y <= y1; ++y)
    for (int x = std::max(0, static_cast<int>(u - radius)); x <= x1; ++x) {
      const float du = static_cast<float>(x) - u, dv = static_cast<float>(y) - v;
      const float h = stored_height(level, leaf, x, y);
      if (h == 0 || du * du + dv * dv > best) continue;
      best = du * du + dv * dv;
      found = h;
    }
  return found;
}

}  // namespace

LayerGrid::LayerGrid(const Level& level, const Layer& layer, std::uint32_t leaf)
    : tile(layer_tile(level, layer, leaf)), row(atlas_size(level, layer)[0]) {
  const RbvhLeaf& heights = level.leaves[leaf];
  per_u = static_cast<float>(tile.width - 1) / static_cast<float>(heights.width - 1);
  per_v = static_cast<float>(tile.height - 1) / static_cast<float>(heights.height - 1);
}

std::array<float, 2> LayerGrid::place(float u, float v) const {
  return {std::clamp(u * per_u, 0.0f, static_cast<float>(tile.width - 1)),
          std::clamp(v * per_v, 0.0f, static_cast<float>(tile.height - 1))};
}

TexelQuad LayerGrid::quad(float u, float v) const {
  const auto [lu, lv] = place(u, v);
  const int x = std::min(static_cast<int>(lu), tile.width - 2),
            y = std::min(static_cast<int>(lv), tile.height - 2);
  const float fu = lu - static_cast<float>(x), fv = lv - static_cast<float>(y);
  return {{texel(x, y), texel(x + 1, y), texel(x, y + 1), texel(x + 1, y + 1)},
          {(1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv}};
}

LeafSurface::LeafSurface(const Level& level, std::uint32_t leaf, std::uint32_t first)
    : level_(level), leaf_(level.leaves[leaf]), first_(first), frame_(leaf_) {}

std::optional<Vec3f> LeafSurface::point(float u, float v, float radius) const {
  if (first_ == RBVH_NO_LEAF) {
    float h = height_at(level_, leaf_, u, v);
    if (std::isnan(h) && radius > 0) h = nearest_height(level_, leaf_, u, v, radius);
    if (std::isnan(h)) return {};
    return frame_.at(u, v, h);
  }
  // From the middle of the leaf's extent along w; the nearest point may lie aside.
  Vec3f place = frame_.at(u, v, 1);
  PrimitivePoint nearest;
  Vec3f on_surface;
  for (int step = 0; step < 2; ++step) {
    nearest = nearest_primitive(level_, first_, leaf_.primitives, place);
    on_surface = point_of(level_.primitives, nearest);
    place = frame_.at(u, v, to_tile(leaf_, on_surface).z);
  }
  const Vec3f at = to_tile(leaf_, on_surface);
  const float aside = std::hypot(at.x - u, at.y - v);
  if (!(aside <= std::max(kReachTexels, radius))) return {};
  return on_surface;
}

}  // namespace rbvh
