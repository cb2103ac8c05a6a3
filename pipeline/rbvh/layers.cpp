#include "pipeline/rbvh/layers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/measure/surface_distance.h"
#include "pipeline/rbvh/atlas.h"
#include "pipeline/rbvh/texel.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 12;
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr float kNearestTexels = 4;
constexpr float kMostCode = 65534;  // codes 1..65535

float decode(const Layer& layer, std::uint16_t code) {
  if (layer.lo == layer.hi) return static_cast<float>(code);
  return layer.lo + (layer.hi - layer.lo) * (static_cast<float>(code - 1) / kMostCode);
}

std::uint16_t encode(const Layer& layer, float value) {
  if (!std::isfinite(value)) return 0;
  if (!(layer.hi > layer.lo)) return 1;
  const float at = (value - layer.lo) / (layer.hi - layer.lo);
  return static_cast<std::uint16_t>(1.5f + std::clamp(at, 0.0f, 1.0f) * kMostCode);
}

void grow_range(Layer& layer, std::span<const float> values) {
  float lo = std::numeric_limits<float>::max(), hi = std::numeric_limits<float>::lowest();
  const bool is_empty =
      std::all_of(layer.texels.begin(), layer.texels.end(), [](auto code) { return code == 0; });
  if (!is_empty) {
    lo = layer.lo;
    hi = layer.hi;
  }
  for (const float value : values) {
    if (!std::isfinite(value)) continue;
    lo = std::min(lo, value);
    hi = std::max(hi, value);
  }
  if (lo > hi || (!is_empty && lo == layer.lo && hi == layer.hi)) return;
  // One value alone is kept as an end of a range: an empty range would mean "as stored".
  if (lo == hi) hi = lo + std::max(1.0f, std::abs(lo));
  if (lo > 0 && std::isinf(hi)) hi = std::exchange(lo, 0.0f);
  if (std::isinf(hi - lo)) {
    char range[64];
    std::snprintf(range, sizeof range, "%g to %g", static_cast<double>(lo), static_cast<double>(hi));
    throw Error(ErrorKind::kInput, "",
                "layer " + layer.name + " would have values from " + range +
                    ", further apart than a float can say; bring them closer together");
  }
  Layer grown;
  grown.lo = lo;
  grown.hi = hi;
  if (!is_empty)
    for (std::uint16_t& code : layer.texels)
      if (code != 0) code = encode(grown, decode(layer, code));
  layer.lo = lo;
  layer.hi = hi;
}

/// A place on a leaf's tile as four texels of a layer and their shares.
struct Quad {
  std::array<std::size_t, 4> texels{};
  std::array<float, 4> shares{};
};

/// A layer's grid over a leaf's tile.
struct LayerGrid {
  LayerTile tile;
  std::size_t row = 0;         ///< of its atlas
  float per_u = 1, per_v = 1;  ///< its texels to one of the heights'

  LayerGrid(const Level& level, const Layer& layer, std::uint32_t leaf)
      : tile(layer_tile(level, layer, leaf)), row(atlas_size(level, layer)[0]) {
    const RbvhLeaf& heights = level.leaves[leaf];
    per_u = static_cast<float>(tile.width - 1) / static_cast<float>(heights.width - 1);
    per_v = static_cast<float>(tile.height - 1) / static_cast<float>(heights.height - 1);
  }
  std::size_t texel(int x, int y) const {
    return (tile.y + static_cast<std::size_t>(y)) * row + tile.x + static_cast<std::size_t>(x);
  }
  Quad quad(float u, float v) const {
    const float lu = std::clamp(u * per_u, 0.0f, static_cast<float>(tile.width - 1)),
                lv = std::clamp(v * per_v, 0.0f, static_cast<float>(tile.height - 1));
    const int x = std::min(static_cast<int>(lu), tile.width - 2),
              y = std::min(static_cast<int>(lv), tile.height - 2);
    const float fu = lu - static_cast<float>(x), fv = lv - static_cast<float>(y);
    return {{texel(x, y), texel(x + 1, y), texel(x, y + 1), texel(x + 1, y + 1)},
            {(1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv}};
  }
};

/// The tile's height at (u, v) texels, between those of the four texels that have one; NaN without any.
float height_at(const Level& level, const RbvhLeaf& leaf, float u, float v) {
  const std::vector<std::uint16_t>& heights = level.layers[0].texels;
  const int x = std::clamp(static_cast<int>(u), 0, leaf.width - 2),
            y = std::clamp(static_cast<int>(v), 0, leaf.height - 2);
  const float fu = u - static_cast<float>(x), fv = v - static_cast<float>(y);
  const float shares[4] = {(1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv};
  float sum = 0, weight = 0;
  for (int k = 0; k < 4; ++k) {
    const float h = heights[(leaf.y + static_cast<std::size_t>(y + k / 2)) * level.atlas_width + leaf.x +
                            static_cast<std::size_t>(x + k % 2)];
    if (h == 0 || shares[k] <= 1e-6f) continue;
    sum += h * shares[k];
    weight += shares[k];
  }
  return weight > 0 ? sum / weight : kNone;
}

/// Of the nearest texel that has one, within `reach` texels; NaN: none.
float nearest_height(const Level& level, const RbvhLeaf& leaf, float u, float v, float reach) {
  const std::vector<std::uint16_t>& heights = level.layers[0].texels;
  float best = reach * reach, found = kNone;
  const int x1 = std::min(leaf.width - 1, static_cast<int>(u + reach)),
            y1 = std::min(leaf.height - 1, static_cast<int>(v + reach));
  for (int y = std::max(0, static_cast<int>(v - reach)); y <= y1; ++y)
    for (int x = std::max(0, static_cast<int>(u - reach)); x <= x1; ++x) {
      const float du = static_cast<float>(x) - u, dv = static_cast<float>(y) - v;
      const float h = heights[(leaf.y + static_cast<std::size_t>(y)) * level.atlas_width + leaf.x +
                              static_cast<std::size_t>(x)];
      if (h == 0 || du * du + dv * dv > best) continue;
      best = du * du + dv * dv;
      found = h;
    }
  return found;
}

Vec3f value3(const Layer& layer, std::uint16_t packed) {
  return layer.name == "normal" ? unpack_normal(packed) : unpack_srgb(packed);
}

/// Adds what the quad says of a layer, times `weight`, and returns the weight that was there to add.
float add_quad(const Level& level, const Layer& layer, const Quad& quad, float weight,
               std::span<double> sum) {
  const bool is_packed = layer.name == "normal" || layer.name == "color";
  float added = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    const float share = weight * quad.shares[k];
    if (!(share > 0)) continue;
    if (is_packed) {
      if (level.layers[0].texels[quad.texels[k]] == 0) continue;
      const Vec3f value = value3(layer, layer.texels[quad.texels[k]]);
      for (int c = 0; c < 3; ++c) sum[static_cast<std::size_t>(c)] += static_cast<double>(value[c] * share);
    } else {
      const std::uint16_t* codes = layer.texels.data() + quad.texels[k] * layer.channels;
      if (codes[0] == 0) continue;
      for (std::size_t c = 0; c < sum.size(); ++c)
        sum[c] += static_cast<double>(decode(layer, codes[c])) * static_cast<double>(share);
    }
    added += share;
  }
  return added;
}

/// Of a tile that has no value around (u, v), as one that keeps its primitives may: the nearest texel that
/// has.
Quad nearest_quad(const Level& level, const Layer& layer, std::uint32_t leaf, float u, float v) {
  const LayerGrid grid(level, layer, leaf);
  const float lu = std::clamp(u * grid.per_u, 0.0f, static_cast<float>(grid.tile.width - 1)),
              lv = std::clamp(v * grid.per_v, 0.0f, static_cast<float>(grid.tile.height - 1));
  Quad nearest;
  float best = kNearestTexels * kNearestTexels;
  std::vector<double> ignored(sample_width(layer));
  for (int y = std::max(0, static_cast<int>(lv - kNearestTexels));
       y < std::min<int>(grid.tile.height, static_cast<int>(lv + kNearestTexels) + 1); ++y)
    for (int x = std::max(0, static_cast<int>(lu - kNearestTexels));
         x < std::min<int>(grid.tile.width, static_cast<int>(lu + kNearestTexels) + 1); ++x) {
      const float du = static_cast<float>(x) - lu, dv = static_cast<float>(y) - lv;
      if (du * du + dv * dv >= best) continue;
      Quad one;
      one.texels[0] = grid.texel(x, y);
      one.shares[0] = 1;
      if (!(add_quad(level, layer, one, 1, ignored) > 0)) continue;
      best = du * du + dv * dv;
      nearest = one;
    }
  return nearest;
}

}  // namespace

bool is_standard_layer(std::string_view name) {
  return name == "height" || name == "normal" || name == "color";
}

Layer make_layer(const Level& level, const std::string& name, std::uint32_t channels, double scale) {
  RBVH_CHECK(scale > 0 && channels > 0);
  Layer layer;
  layer.name = name;
  layer.channels = channels;
  if (scale != 1) {
    std::vector<Tile> tiles(level.leaves.size());
    const auto side = [&](std::uint16_t texels) {
      const double wanted = std::max(1.0, std::round((texels - 1) * scale)) + 1;
      if (!(wanted <= 65535))
        throw Error(ErrorKind::kBudget, "",
                    "layer " + name + " would have tiles over 65535 texels wide; lower its scale");
      return static_cast<std::uint16_t>(wanted);
    };
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      tiles[i].leaf.width = side(level.leaves[i].width);
      tiles[i].leaf.height = side(level.leaves[i].height);
    }
    const AtlasSize size = pack_tiles(tiles);
    layer.width = size.width;
    layer.height = size.height;
    for (const Tile& tile : tiles)
      layer.tiles.push_back({tile.leaf.x, tile.leaf.y, tile.leaf.width, tile.leaf.height});
  }
  const auto [width, height] = atlas_size(level, layer);
  layer.texels.resize(std::size_t{width} * height * channels);
  return layer;
}

LayerPoints layer_points(const Level& level, const Layer& layer) {
  LayerPoints result;
  for (std::uint32_t k = 0; k < level.leaves.size(); ++k) {
    const RbvhLeaf& leaf = level.leaves[k];
    const TileFrame frame(leaf);
    const LayerGrid grid(level, layer, k);
    for (int y = 0; y < grid.tile.height; ++y)
      for (int x = 0; x < grid.tile.width; ++x) {
        const float u = static_cast<float>(x) / grid.per_u, v = static_cast<float>(y) / grid.per_v;
        float h = height_at(level, leaf, u, v);
        // Coarse texels reach past the heights' rim as fine ones do: reads there need all four.
        const float side = std::max(1 / grid.per_u, 1 / grid.per_v);
        if (std::isnan(h) && side > 1) h = nearest_height(level, leaf, u, v, 1.5f * side);
        if (std::isnan(h)) continue;
        result.texels.push_back(grid.texel(x, y));
        result.points.push_back(frame.at(u, v, h));
      }
  }
  return result;
}

std::vector<float> property_at(const Scan& scan, const ScalarProperty& property,
                               std::span<const Vec3f> points) {
  // A cloud's points are triangles without an extent.
  TriangleSoup soup;
  std::vector<Triangle> corners;
  const auto add = [&](const Triangle& t) {
    for (const std::uint32_t i : t)
      if (!is_finite(scan.positions[i])) return;
    corners.push_back(t);
    for (const std::uint32_t i : t) soup.push_back(scan.positions[i]);
  };
  for (const Triangle& t : scan.triangles) add(t);
  if (scan.is_cloud())
    for (std::uint32_t i = 0; i < scan.positions.size(); ++i) add({i, i, i});
  const ClosestPoint closest(std::move(soup));
  std::vector<float> values(points.size(), kNone);
  parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const ClosestPoint::Nearest nearest = closest.find(points[i]);
      if (!std::isfinite(nearest.distance)) continue;
      const Triangle& t = corners[nearest.triangle];
      const Vec3f a = scan.positions[t[0]], ab = scan.positions[t[1]] - a, ac = scan.positions[t[2]] - a,
                  ap = nearest.point - a, n = cross(ab, ac);
      const float area = dot(n, n);
      const float v = area > 0 ? std::clamp(dot(cross(ap, ac), n) / area, 0.0f, 1.0f) : 0;
      const float w = area > 0 ? std::clamp(dot(cross(ab, ap), n) / area, 0.0f, 1.0f) : 0;
      const auto share = [&](std::size_t corner, float weight) {
        return weight > 0 ? property.values[t[corner]] * weight : 0.0f;  // a corner's NaN stays its own
      };
      values[i] = share(0, std::max(0.0f, 1 - v - w)) + share(1, v) + share(2, w);
    }
  });
  return values;
}

void set_values(Layer& layer, std::span<const std::size_t> texels, std::span<const float> values) {
  RBVH_CHECK(texels.size() * layer.channels == values.size());
  grow_range(layer, values);
  for (std::size_t i = 0; i < texels.size(); ++i) {
    std::uint16_t* codes = layer.texels.data() + texels[i] * layer.channels;
    const float* from = values.data() + i * layer.channels;
    // A texel has all its channels or none.
    const bool has_value = std::all_of(from, from + layer.channels, [](float v) { return std::isfinite(v); });
    for (std::size_t c = 0; c < layer.channels; ++c) codes[c] = has_value ? encode(layer, from[c]) : 0;
  }
}

void add_property_layers(std::vector<Level>& levels, const Scan& scan, const std::vector<std::string>& names,
                         double scale, const Progress& progress) {
  double done = 0;
  for (const std::string& name : names) {
    const auto property = std::find_if(scan.properties.begin(), scan.properties.end(),
                                       [&](const ScalarProperty& p) { return p.name == name; });
    if (property == scan.properties.end() || is_standard_layer(name)) {
      std::string there;
      for (const ScalarProperty& p : scan.properties) there += (there.empty() ? "" : ", ") + p.name;
      throw Error(ErrorKind::kUsage, "",
                  "the scan's vertices have no property '" + name + "' to make a layer of; there " +
                      (there.empty() ? "are none" : "are " + there));
    }
    for (Level& level : levels) {
      report(progress, "layers", done / static_cast<double>(names.size() * levels.size()));
      Layer layer = make_layer(level, name, 1, scale);
      const LayerPoints points = layer_points(level, layer);
      set_values(layer, points.texels, property_at(scan, *property, points.points));
      std::erase_if(level.layers, [&](const Layer& other) { return other.name == name; });
      level.layers.push_back(std::move(layer));
      done += 1;
    }
  }
}

std::size_t sample_width(const Layer& layer) {
  return layer.name == "normal" || layer.name == "color" ? 3 : layer.channels;
}

std::vector<float> sample_layer(const PointIndex& index, const Level& level, const Layer& layer,
                                std::span<const Vec3f> points, float most) {
  const PointHits hits = query_points(index, points);
  const std::size_t width = sample_width(layer);
  std::vector<float> values(points.size() * width, kNone);
  parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<double> sum(width);  // of values up to the largest float
    for (std::size_t i = begin; i < end; ++i) {
      std::fill(sum.begin(), sum.end(), 0.0);
      float weight = 0;
      const std::vector<Covering> covers = covering(level, hits.of(i), most);
      for (const Covering& c : covers) {
        if (layer.name == "height") {
          sum[0] += static_cast<double>(c.distance * c.weight);
          weight += c.weight;
        } else {
          weight += add_quad(level, layer, LayerGrid(level, layer, c.leaf).quad(c.u, c.v), c.weight, sum);
        }
      }
      for (std::size_t k = 0; k < covers.size() && !(weight > 0); ++k)
        weight += add_quad(level, layer, nearest_quad(level, layer, covers[k].leaf, covers[k].u, covers[k].v),
                           1, sum);
      if (!(weight > 0)) continue;
      float* to = values.data() + i * width;
      for (std::size_t c = 0; c < width; ++c)
        to[c] = static_cast<float>(sum[c] / static_cast<double>(weight));
      if (layer.name != "normal") continue;
      const Vec3f n = normalized(Vec3f{to[0], to[1], to[2]});
      std::copy_n(&n.x, 3, to);
    }
  });
  return values;
}

std::vector<float> sample_layer_at_hits(const Level& level, const Layer& layer, std::span<const Hit> hits) {
  RBVH_CHECK(layer.name != "height");
  const std::size_t width = sample_width(layer);
  std::vector<float> values(hits.size() * width, kNone);
  parallel_for(hits.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<double> sum(width);  // of values up to the largest float
    for (std::size_t i = begin; i < end; ++i) {
      if (!std::isfinite(hits[i].t)) continue;
      const RbvhLeaf& leaf = level.leaves[hits[i].leaf];
      std::fill(sum.begin(), sum.end(), 0.0);
      const Quad quad = LayerGrid(level, layer, hits[i].leaf)
                            .quad(hits[i].u * static_cast<float>(leaf.width - 1),
                                  hits[i].v * static_cast<float>(leaf.height - 1));
      const float weight = add_quad(level, layer, quad, 1, sum);
      for (std::size_t c = 0; c < width && weight > 0; ++c)
        values[i * width + c] = static_cast<float>(sum[c] / static_cast<double>(weight));
    }
  });
  return values;
}

PaintCounts paint_layer(const PointIndex& index, const Level& level, Layer& layer,
                        std::span<const Vec3f> points, std::span<const float> values, float radius,
                        float most) {
  const std::size_t width = sample_width(layer);
  RBVH_CHECK(values.size() == points.size() * width && layer.name != "height" && layer.name != "normal");
  const PointHits hits = query_points(index, points, std::max(radius, 0.0f));
  struct Claim {
    float distance2 = std::numeric_limits<float>::infinity();
    std::uint32_t point = 0;
  };
  const auto [atlas_width, atlas_height] = atlas_size(level, layer);
  std::vector<Claim> claims(std::size_t{atlas_width} * atlas_height);
  PaintCounts counts;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3f p = points[i];
    const auto claim = [&](std::size_t texel, float distance2) {
      Claim& c = claims[texel];
      if (distance2 <= c.distance2) c = {distance2, static_cast<std::uint32_t>(i)};
    };
    const std::vector<Covering> covers = covering(level, hits.of(i), most);
    counts.points_missed += covers.empty();
    if (covers.empty()) continue;
    for (const Covering& c : covers) {
      // The four texels that a read here goes by, wherever their own points lie.
      const LayerGrid grid(level, layer, c.leaf);
      const Quad quad = grid.quad(c.u, c.v);
      const RbvhLeaf& leaf = level.leaves[c.leaf];
      const float texel = 1 / length(Vec3f{leaf.to_tile[0], leaf.to_tile[1], leaf.to_tile[2]}) / grid.per_u;
      for (std::size_t k = 0; k < 4; ++k) claim(quad.texels[k], texel * texel * (1 - quad.shares[k]));
    }
    if (!(radius > 0)) continue;
    for (const PointHit& hit : hits.of(i)) {
      const RbvhLeaf& leaf = level.leaves[hit.leaf];
      const TileFrame frame(leaf);
      const LayerGrid grid(level, layer, hit.leaf);
      const float reach_u = radius / static_cast<float>(length(frame.u)) * grid.per_u,
                  reach_v = radius / static_cast<float>(length(frame.v)) * grid.per_v;
      const auto place = [](float at, int size) {
        return static_cast<int>(std::clamp(at, 0.0f, static_cast<float>(size)));
      };
      const int x0 = place(hit.u * grid.per_u - reach_u, grid.tile.width),
                x1 = place(hit.u * grid.per_u + reach_u + 1, grid.tile.width),
                y0 = place(hit.v * grid.per_v - reach_v, grid.tile.height),
                y1 = place(hit.v * grid.per_v + reach_v + 1, grid.tile.height);
      for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x) {
          const float u = static_cast<float>(x) / grid.per_u, v = static_cast<float>(y) / grid.per_v;
          const float h = height_at(level, leaf, u, v);
          if (std::isnan(h)) continue;
          const Vec3f d = frame.at(u, v, h) - p;
          if (dot(d, d) <= radius * radius) claim(grid.texel(x, y), dot(d, d));
        }
    }
  }

  std::vector<std::size_t> texels;
  std::vector<float> painted;
  for (std::size_t texel = 0; texel < claims.size(); ++texel) {
    if (!std::isfinite(claims[texel].distance2)) continue;
    const float* value = values.data() + claims[texel].point * width;
    ++counts.texels;
    if (layer.name == "color") {
      if (is_finite(Vec3f{value[0], value[1], value[2]}))
        layer.texels[texel] = pack_srgb({value[0], value[1], value[2]});
      continue;
    }
    texels.push_back(texel);
    painted.insert(painted.end(), value, value + width);
  }
  if (layer.name != "color") set_values(layer, texels, painted);
  return counts;
}

}  // namespace rbvh
