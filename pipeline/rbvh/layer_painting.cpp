#include "pipeline/rbvh/layer_painting.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/layer_codec.h"
#include "pipeline/rbvh/layer_grid.h"
#include "pipeline/rbvh/layer_sampling.h"
#include "pipeline/rbvh/layers.h"
#include "pipeline/rbvh/leaf_primitives.h"
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
void claim_near_texels(const Level& level, const Layer& layer, std::uint32_t first, const PointHit& hit,
                       Vec3f p, float radius, std::uint32_t point, std::vector<Claim>& claims) {
  const RbvhLeaf& leaf = level.leaves[hit.leaf];
  const TileFrame frame(leaf);
  const LeafSurface surface(level, hit.leaf, first);
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
      const std::optional<Vec3f> at = surface.point(u, v, 0);
      if (!at) continue;
      const Vec3f d = *at - p;
      if (dot(d, d) <= radius * radius) claims[grid.texel(x, y)].add(point, dot(d, d));
    }
}

/// The corners of a leaf's primitives within the radius of p, and that of the nearest primitive that is
/// nearest to p: colours of primitives are their vertices'.
void claim_vertices(const Level& level, std::uint32_t first, std::uint32_t leaf, Vec3f p, float radius,
                    std::uint32_t point, std::vector<Claim>& claims) {
  const Scan& primitives = level.primitives;
  const std::uint32_t count = level.leaves[leaf].primitives;
  const auto distance2 = [&](std::uint32_t vertex) {
    const Vec3f d = primitives.positions[vertex] - p;
    return dot(d, d);
  };
  const Triangle near = primitive_corners(primitives, nearest_primitive(level, first, count, p).primitive);
  const std::uint32_t nearest = *std::min_element(
      near.begin(), near.end(), [&](auto a, auto b) { return distance2(a) < distance2(b); });
  claims[nearest].add(point, distance2(nearest));
  for (std::uint32_t i = first; i < first + count; ++i)
    for (const std::uint32_t vertex : primitive_corners(primitives, i))
      if (distance2(vertex) <= radius * radius) claims[vertex].add(point, distance2(vertex));
}

/// Colours of the claimed vertices; returns their number.
std::uint64_t write_vertices(Scan& primitives, const std::vector<Claim>& claims,
                             std::span<const float> values) {
  std::uint64_t count = 0;
  for (std::size_t vertex = 0; vertex < claims.size(); ++vertex) {
    if (!std::isfinite(claims[vertex].distance2)) continue;
    const float* value = values.data() + std::size_t{claims[vertex].point} * 3;
    if (!is_finite(Vec3f{value[0], value[1], value[2]})) continue;
    for (std::size_t c = 0; c < 3; ++c)
      primitives.colors[vertex][c] = static_cast<std::uint8_t>(std::clamp(value[c], 0.0f, 1.0f) * 255 + 0.5f);
    ++count;
  }
  return count;
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

PaintCounts paint_layer(const PointIndex& index, Level& level, Layer& layer, std::span<const Vec3f> points,
                        std::span<const float> values, float radius, float most) {
  const std::size_t width = sample_width(layer);
  const LayerKind kind = layer_kind(layer.name);
  RBVH_CHECK(values.size() == points.size() * width &&
             (kind == LayerKind::kColor || kind == LayerKind::kUser));
  const PointHits hits = query_points(index, points, std::max(radius, 0.0f));
  const auto [atlas_width, atlas_height] = atlas_size(level, layer);
  std::vector<Claim> claims(std::size_t{atlas_width} * atlas_height), vertex_claims;
  if (kind == LayerKind::kColor) vertex_claims.resize(level.primitives.colors.size());
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  const auto lies_in_tile = [&](std::uint32_t leaf) {
    return kind == LayerKind::kUser || firsts[leaf] == RBVH_NO_LEAF;
  };
  PaintCounts counts;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const std::vector<Covering> covers = covering(level, hits.of(i), most);
    counts.points_missed += covers.empty();
    if (covers.empty()) continue;
    for (const Covering& cover : covers) {
      if (lies_in_tile(cover.leaf))
        claim_read_texels(level, layer, cover, i, claims);
      else
        claim_vertices(level, firsts[cover.leaf], cover.leaf, points[i], 0, i, vertex_claims);
    }
    if (!(radius > 0)) continue;
    for (const PointHit& hit : hits.of(i)) {
      if (lies_in_tile(hit.leaf))
        claim_near_texels(level, layer, firsts[hit.leaf], hit, points[i], radius, i, claims);
      else
        claim_vertices(level, firsts[hit.leaf], hit.leaf, points[i], radius, i, vertex_claims);
    }
  }
  counts.texels =
      write_claims(layer, claims, values, width) + write_vertices(level.primitives, vertex_claims, values);
  return counts;
}

std::vector<std::pair<std::string, PaintCounts>> paint_levels(const Device& device, Rbvh& rbvh,
                                                              const std::vector<std::string>& levels,
                                                              const PointPaint& paint,
                                                              const std::string& file) {
  const float reach = paint.reach.value_or(default_reach(rbvh));
  std::vector<std::pair<std::string, PaintCounts>> painted;
  for (Level& level : rbvh.levels) {
    if (std::find(levels.begin(), levels.end(), level.name) == levels.end()) continue;
    if (paint.scale && find_layer(level, paint.layer) != nullptr)
      throw Error(ErrorKind::kUsage, file,
                  "layer " + paint.layer + " of level " + level.name + " is there and has its resolution",
                  Remedy::kNewLayer);
    Layer& layer = layer_to_paint(level, paint.layer, paint.width, paint.scale.value_or(1), file);
    painted.emplace_back(level.name, paint_layer(make_point_index(device, level), level, layer, paint.points,
                                                 paint.values, paint.radius, reach));
  }
  return painted;
}

}  // namespace rbvh
