#include "pipeline/rbvh/layer_sampling.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/rbvh/height_normals.h"
#include "pipeline/rbvh/layer_codec.h"
#include "pipeline/rbvh/layer_grid.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/texel.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 12;
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
/// Radius within which a texel with a value is searched where none is around the point.
constexpr float kNearestTexels = 4;

/// Adds weight times the texel's value, where it has one.
bool add_texel(const Level& level, const Layer& layer, std::size_t texel, float weight,
               std::span<double> sum) {
  const LayerKind kind = layer_kind(layer.name);
  if (kind == LayerKind::kNormal || kind == LayerKind::kColor) {
    if (level.layers[0].texels[texel] == 0) return false;
    const std::uint16_t packed = layer.texels[texel];
    const Vec3f value = kind == LayerKind::kNormal ? unpack_normal(packed) : unpack_srgb(packed);
    for (int c = 0; c < 3; ++c) sum[static_cast<std::size_t>(c)] += static_cast<double>(value[c] * weight);
    return true;
  }
  const std::uint16_t* codes = layer.texels.data() + texel * layer.channels;
  if (codes[0] == 0) return false;
  for (std::size_t c = 0; c < sum.size(); ++c)
    sum[c] += static_cast<double>(decode(layer, codes[c])) * static_cast<double>(weight);
  return true;
}

/// Adds the quad's values times `weight`; returns the weight of the texels that have one.
float add_quad(const Level& level, const Layer& layer, const TexelQuad& quad, float weight,
               std::span<double> sum) {
  float added = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    const float share = weight * quad.weights[k];
    if (share > 0 && add_texel(level, layer, quad.texels[k], share, sum)) added += share;
  }
  return added;
}

/// Adds weight times what a leaf's primitives have at their point nearest to p: a normal or a colour.
float add_primitive(const Level& level, LayerKind kind, std::uint32_t first, std::uint32_t leaf, Vec3f p,
                    float weight, std::span<double> sum) {
  const Scan& primitives = level.primitives;
  if (kind == LayerKind::kColor ? primitives.colors.empty() : primitives.normals.empty()) return 0;
  const PrimitivePoint at = nearest_primitive(level, first, level.leaves[leaf].primitives, p);
  const Vec3f value = kind == LayerKind::kColor ? srgb_at(primitives, at) : normal_at(primitives, at);
  for (int c = 0; c < 3; ++c) sum[static_cast<std::size_t>(c)] += static_cast<double>(value[c] * weight);
  return weight;
}

/// The nearest texel that has a value, for a place whose four texels have none.
TexelQuad nearest_quad(const Level& level, const Layer& layer, std::uint32_t leaf, float u, float v) {
  const LayerGrid grid(level, layer, leaf);
  const auto [lu, lv] = grid.place(u, v);
  TexelQuad nearest;
  float best = kNearestTexels * kNearestTexels;
  std::vector<double> ignored(sample_width(layer));
  for (int y = std::max(0, static_cast<int>(lv - kNearestTexels));
       y < std::min<int>(grid.tile.height, static_cast<int>(lv + kNearestTexels) + 1); ++y)
    for (int x = std::max(0, static_cast<int>(lu - kNearestTexels));
         x < std::min<int>(grid.tile.width, static_cast<int>(lu + kNearestTexels) + 1); ++x) {
      const float du = static_cast<float>(x) - lu, dv = static_cast<float>(y) - lv;
      if (du * du + dv * dv >= best || !add_texel(level, layer, grid.texel(x, y), 1, ignored)) continue;
      best = du * du + dv * dv;
      nearest.texels[0] = grid.texel(x, y);
      nearest.weights[0] = 1;
    }
  return nearest;
}

/// Adds the weighted values of the leaves that cover p; returns the sum of the weights. `firsts`: of
/// first_primitives().
float add_coverings(const Level& level, const Layer& layer, std::span<const std::uint32_t> firsts,
                    const std::vector<Covering>& covers, Vec3f p, std::span<double> sum) {
  const LayerKind kind = layer_kind(layer.name);
  const auto lies_in_tile = [&](const Covering& c) {
    return kind == LayerKind::kUser || firsts[c.leaf] == RBVH_NO_LEAF;
  };
  float weight = 0;
  for (const Covering& c : covers) {
    if (kind == LayerKind::kHeight) {
      sum[0] += static_cast<double>(c.distance * c.weight);
      weight += c.weight;
    } else if (!lies_in_tile(c)) {
      weight += add_primitive(level, kind, firsts[c.leaf], c.leaf, p, c.weight, sum);
    } else {
      weight += add_quad(level, layer, LayerGrid(level, layer, c.leaf).quad(c.u, c.v), c.weight, sum);
    }
  }
  for (std::size_t k = 0; k < covers.size() && !(weight > 0); ++k)
    if (lies_in_tile(covers[k]))
      weight += add_quad(level, layer, nearest_quad(level, layer, covers[k].leaf, covers[k].u, covers[k].v),
                         1, sum);
  return weight;
}

}  // namespace

std::size_t sample_width(const Layer& layer) {
  const LayerKind kind = layer_kind(layer.name);
  return kind == LayerKind::kNormal || kind == LayerKind::kColor ? 3 : layer.channels;
}

Layer layer_to_sample(const Level& level, const std::string& name, const std::string& file) {
  if (const Layer* layer = find_layer(level, name)) return *layer;
  if (layer_kind(name) == LayerKind::kNormal) return make_normal_layer(level);
  std::string there;
  for (const Layer& each : level.layers) there += (there.empty() ? "" : ", ") + each.name;
  throw Error(ErrorKind::kUsage, file,
              "level " + level.name + " has no layer '" + name + "'; there are " + there);
}

float default_reach(const Rbvh& rbvh) { return 0.01f * rbvh.source.bounds.diagonal(); }

std::vector<float> sample_layer(const PointIndex& index, const Level& level, const Layer& layer,
                                std::span<const Vec3f> points, float most) {
  const PointHits hits = query_points(index, points);
  const std::size_t width = sample_width(layer);
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  std::vector<float> values(points.size() * width, kNone);
  parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<double> sum(width);  // of values up to the largest float
    for (std::size_t i = begin; i < end; ++i) {
      std::fill(sum.begin(), sum.end(), 0.0);
      const float weight =
          add_coverings(level, layer, firsts, covering(level, hits.of(i), most), points[i], sum);
      if (!(weight > 0)) continue;
      float* to = values.data() + i * width;
      for (std::size_t c = 0; c < width; ++c)
        to[c] = static_cast<float>(sum[c] / static_cast<double>(weight));
      if (layer_kind(layer.name) != LayerKind::kNormal) continue;
      const Vec3f n = normalized(Vec3f{to[0], to[1], to[2]});
      std::copy_n(&n.x, 3, to);
    }
  });
  return values;
}

std::vector<float> sample_layer_at_hits(const Level& level, const Layer& layer, std::span<const Hit> hits) {
  RBVH_CHECK(layer_kind(layer.name) != LayerKind::kHeight);
  const std::size_t width = sample_width(layer);
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  std::vector<float> values(hits.size() * width, kNone);
  parallel_for(hits.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<double> sum(width);  // of values up to the largest float
    for (std::size_t i = begin; i < end; ++i) {
      if (!std::isfinite(hits[i].t)) continue;
      const RbvhLeaf& leaf = level.leaves[hits[i].leaf];
      std::fill(sum.begin(), sum.end(), 0.0);
      float u = hits[i].u * static_cast<float>(leaf.width - 1),
            v = hits[i].v * static_cast<float>(leaf.height - 1), weight = 0;
      const std::optional<PrimitivePoint> primitive = primitive_at(level, firsts[hits[i].leaf], hits[i]);
      const Vec3f p = primitive ? point_of(level.primitives, *primitive) : Vec3f{};
      if (primitive) {
        const Vec3f place = to_tile(leaf, p);
        u = place.x;
        v = place.y;
      }
      if (primitive && layer_kind(layer.name) != LayerKind::kUser)
        weight = add_primitive(level, layer_kind(layer.name), firsts[hits[i].leaf], hits[i].leaf, p, 1, sum);
      else
        weight = add_quad(level, layer, LayerGrid(level, layer, hits[i].leaf).quad(u, v), 1, sum);
      for (std::size_t c = 0; c < width && weight > 0; ++c)
        values[i * width + c] = static_cast<float>(sum[c] / static_cast<double>(weight));
    }
  });
  return values;
}

}  // namespace rbvh
