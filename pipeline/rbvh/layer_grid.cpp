#include "pipeline/rbvh/layer_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/scan/closest_point.h"

namespace rbvh {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
/// Texels of a frame of primitives this far beside them still count: reads at their edge use all four.
constexpr float kReachTexels = 2;
/// Texels: places as near are the same.
constexpr float kSamePlace = 1e-3f;
/// Of a disc, seen along the frame's w: a cosine.
constexpr float kLeastSlope = 0.1f;

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
    : level_(level), leaf_(level.leaves[leaf]), first_(first), frame_(leaf_) {
  if (first == RBVH_NO_LEAF) return;
  corners_.reserve(3 * std::size_t{leaf_.primitives});
  for (std::uint32_t i = 0; i < leaf_.primitives; ++i)
    for (const std::uint32_t vertex : primitive_corners(level.primitives, first + i))
      corners_.push_back(to_tile(leaf_, level.primitives.positions[vertex]));
}

std::optional<Vec3f> LeafSurface::point(float u, float v, float radius) const {
  if (first_ == RBVH_NO_LEAF) {
    float h = height_at(level_, leaf_, u, v);
    if (std::isnan(h) && radius > 0) h = nearest_height(level_, leaf_, u, v, radius);
    if (std::isnan(h)) return {};
    return frame_.at(u, v, h);
  }
  // In the plane of the frame; of those that lie there as near, the highest: it is seen from outside.
  const Scan& primitives = level_.primitives;
  float least = std::max(kReachTexels, radius), highest = 0;
  const Vec3f row{leaf_.to_tile[0], leaf_.to_tile[1], leaf_.to_tile[2]};
  const float texels_per_unit = length(row);
  std::optional<PrimitivePoint> best;
  for (std::uint32_t i = 0; i < leaf_.primitives; ++i) {
    PrimitivePoint here{.primitive = first_ + i};
    const Vec3f* const corner = &corners_[3 * std::size_t{i}];
    Vec3f at = corner[0];
    if (!holds_discs(level_)) {
      const Vec3f &a = corner[0], &b = corner[1], &c = corner[2];
      const auto beside = [](float p, float q, float r, float place) {
        return std::max({std::min({p, q, r}) - place, place - std::max({p, q, r})});
      };
      if (std::max(beside(a.x, b.x, c.x, u), beside(a.y, b.y, c.y, v)) > least) continue;
      here.weights = nearest_weights({u, v, 0}, {a.x, a.y, 0}, {b.x, b.y, 0}, {c.x, c.y, 0});
      at = a * here.weights[0] + b * here.weights[1] + c * here.weights[2];
    }
    float aside = std::hypot(at.x - u, at.y - v);
    if (holds_discs(level_))
      aside = std::max(0.0f, aside - primitives.radii[here.primitive] * texels_per_unit);
    if (!(aside <= least) || (best && aside > least - kSamePlace && at.z <= highest)) continue;
    least = std::max(aside, kSamePlace);
    highest = at.z;
    best = here;
  }
  if (!best) return {};
  if (!holds_discs(level_)) return point_of(primitives, *best);
  // On the disc's plane, straight over the place.
  const Vec3f from = frame_.at(u, v, highest), normal = primitives.normals[best->primitive];
  const auto w = static_cast<Vec3f>(normalized(frame_.w));
  const float slope = dot(normal, w);
  return std::abs(slope) < kLeastSlope
             ? from
             : from + w * (dot(normal, primitives.positions[best->primitive] - from) / slope);
}

}  // namespace rbvh
