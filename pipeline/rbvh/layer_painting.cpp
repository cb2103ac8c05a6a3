#include "pipeline/rbvh/layer_painting.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/layer_codec.h"
#include "pipeline/rbvh/layer_grid.h"
#include "pipeline/rbvh/layer_sampling.h"
#include "pipeline/rbvh/layers.h"
#include "pipeline/rbvh/texel.h"

namespace rbvh {
namespace {

/// The nearest point so far that paints a texel.
struct Claim {
  float distance2 = std::numeric_limits<float>::infinity();
  std::uint32_t point = 0;

  void add(std::uint32_t other, float other_distance2) {
    if (other_distance2 <= distance2) *this = {other_distance2, other};
  }
};

/// The four texels that a read at the point uses, wherever their own places are.
void claim_read_texels(const Level& level, const Layer& layer, const Covering& cover, std::uint32_t point,
                       std::vector<Claim>& claims) {
  const LayerGrid grid(level, layer, cover.leaf);
  const TexelQuad quad = grid.quad(cover.u, cover.v);
  const RbvhLeaf& leaf = level.leaves[cover.leaf];
  const float texel = 1 / length(Vec3f{leaf.to_tile[0], leaf.to_tile[1], leaf.to_tile[2]}) / grid.per_u;
  for (std::size_t k = 0; k < 4; ++k)
    claims[quad.texels[k]].add(point, texel * texel * (1 - quad.weights[k]));
}

/// The leaf's texels whose places on the surface are within the radius of p.
void claim_near_texels(const Level& level, const Layer& layer, const PointHit& hit, Vec3f p, float radius,
                       std::uint32_t point, std::vector<Claim>& claims) {
  const RbvhLeaf& leaf = level.leaves[hit.leaf];
  const TileFrame frame(leaf);
  const LayerGrid grid(level, layer, hit.leaf);
  const float radius_u = radius / static_cast<float>(length(frame.u)) * grid.per_u,
              radius_v = radius / static_cast<float>(length(frame.v)) * grid.per_v;
  const auto clamped = [](float at, int size) {
    return static_cast<int>(std::clamp(at, 0.0f, static_cast<float>(size)));
  };
  const int x0 = clamped(hit.u * grid.per_u - radius_u, grid.tile.width),
            x1 = clamped(hit.u * grid.per_u + radius_u + 1, grid.tile.width),
            y0 = clamped(hit.v * grid.per_v - radius_v, grid.tile.height),
            y1 = clamped(hit.v * grid.per_v + radius_v + 1, grid.tile.height);
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x) {
      const float u = static_cast<float>(x) / grid.per_u, v = static_cast<float>(y) / grid.per_v;
      const float h = height_at(level, leaf, u, v);
      if (std::isnan(h)) continue;
      const Vec3f d = frame.at(u, v, h) - p;
      if (dot(d, d) <= radius * radius) claims[grid.texel(x, y)].add(point, dot(d, d));
    }
}

/// Writes the claimed texels; returns their number.
std::uint64_t write_claims(Layer& layer, const std::vector<Claim>& claims, std::span<const float> values,
                           std::size_t width) {
  std::uint64_t count = 0;
  std::vector<std::size_t> texels;
  std::vector<float> painted;
  for (std::size_t texel = 0; texel < claims.size(); ++texel) {
    if (!std::isfinite(claims[texel].distance2)) continue;
    const float* value = values.data() + claims[texel].point * width;
    ++count;
    if (layer_kind(layer.name) == LayerKind::kColor) {
      if (is_finite(Vec3f{value[0], value[1], value[2]}))
        layer.texels[texel] = pack_srgb({value[0], value[1], value[2]});
      continue;
    }
    texels.push_back(texel);
    painted.insert(painted.end(), value, value + width);
  }
  if (layer_kind(layer.name) != LayerKind::kColor) set_values(layer, texels, painted);
  return count;
}

}  // namespace

Layer& layer_to_paint(Level& level, const std::string& name, std::size_t width, double scale,
                      const std::string& file) {
  for (Layer& layer : level.layers) {
    if (layer.name != name) continue;
    if (sample_width(layer) != width)
      throw Error(ErrorKind::kUsage, file,
                  "layer " + name + " has " + std::to_string(sample_width(layer)) +
                      " values a point, and there are " + std::to_string(width));
    return layer;
  }
  if (layer_kind(name) != LayerKind::kUser)
    throw Error(ErrorKind::kUsage, file, "level " + level.name + " has no layer " + name + " to paint on");
  level.layers.push_back(make_layer(level, name, static_cast<std::uint32_t>(width), scale));
  return level.layers.back();
}

PaintCounts paint_layer(const PointIndex& index, const Level& level, Layer& layer,
                        std::span<const Vec3f> points, std::span<const float> values, float radius,
                        float most) {
  const std::size_t width = sample_width(layer);
  const LayerKind kind = layer_kind(layer.name);
  RBVH_CHECK(values.size() == points.size() * width &&
             (kind == LayerKind::kColor || kind == LayerKind::kUser));
  const PointHits hits = query_points(index, points, std::max(radius, 0.0f));
  const auto [atlas_width, atlas_height] = atlas_size(level, layer);
  std::vector<Claim> claims(std::size_t{atlas_width} * atlas_height);
  PaintCounts counts;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const std::vector<Covering> covers = covering(level, hits.of(i), most);
    counts.points_missed += covers.empty();
    if (covers.empty()) continue;
    for (const Covering& cover : covers) claim_read_texels(level, layer, cover, i, claims);
    if (!(radius > 0)) continue;
    for (const PointHit& hit : hits.of(i)) claim_near_texels(level, layer, hit, points[i], radius, i, claims);
  }
  counts.texels = write_claims(layer, claims, values, width);
  return counts;
}

}  // namespace rbvh
