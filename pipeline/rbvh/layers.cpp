#include "pipeline/rbvh/layers.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/rbvh/layer_codec.h"
#include "pipeline/rbvh/layer_grid.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/level_surface.h"
#include "pipeline/rbvh/pack_atlas.h"
#include "pipeline/rbvh/texel.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 12;
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

}  // namespace

Layer make_layer(const Level& level, const std::string& name, std::uint32_t channels, double scale) {
  RBVH_CHECK(scale > 0 && channels > 0);
  Layer layer;
  layer.name = name;
  layer.channels = channels;
  if (scale != 1 || !level.primitive_leaves.empty()) {
    std::vector<RbvhLeaf> tiles(level.leaves.size());
    const auto side = [&](std::uint16_t texels) {
      const double wanted = std::max(1.0, std::round((texels - 1) * scale)) + 1;
      if (!(wanted <= 65535))
        throw Error(ErrorKind::kBudget, "",
                    "layer " + name + " would have tiles over 65535 texels wide; lower its scale");
      return static_cast<std::uint16_t>(wanted);
    };
    std::vector<RbvhLeaf*> all;
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      tiles[i].width = side(level.leaves[i].width);
      tiles[i].height = side(level.leaves[i].height);
      all.push_back(&tiles[i]);
    }
    const AtlasSize size = pack_tiles(all);
    layer.width = size.width;
    layer.height = size.height;
    for (const RbvhLeaf& tile : tiles) layer.tiles.push_back({tile.x, tile.y, tile.width, tile.height});
  }
  const auto [width, height] = atlas_size(level, layer);
  layer.texels.resize(std::size_t{width} * height * channels);
  return layer;
}

LayerPoints layer_points(const Level& level, const Layer& layer) {
  LayerPoints result;
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  for (std::uint32_t k = 0; k < level.leaves.size(); ++k) {
    const LeafSurface surface(level, k, firsts[k]);
    const LayerGrid grid(level, layer, k);
    for (int y = 0; y < grid.tile.height; ++y)
      for (int x = 0; x < grid.tile.width; ++x) {
        const float u = static_cast<float>(x) / grid.per_u, v = static_cast<float>(y) / grid.per_v;
        // Coarse texels extend past the heights' border, as fine ones do: reads there use all four.
        const float side = std::max(1 / grid.per_u, 1 / grid.per_v);
        const std::optional<Vec3f> point = surface.point(u, v, side > 1 ? 1.5f * side : 0);
        if (!point) continue;
        result.texels.push_back(grid.texel(x, y));
        result.points.push_back(*point);
      }
  }
  return result;
}

std::vector<float> property_at(const Scan& scan, const ScalarProperty& property,
                               std::span<const Vec3f> points) {
  // A cloud's points become degenerate triangles.
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
      const auto weighted = [&](std::size_t corner, float weight) {
        return weight > 0 ? property.values[t[corner]] * weight
                          : 0.0f;  // a NaN must not spread to where its weight is 0
      };
      values[i] = weighted(0, std::max(0.0f, 1 - v - w)) + weighted(1, v) + weighted(2, w);
    }
  });
  return values;
}

void add_property_layers(std::span<Level> levels, const Scan& scan, const std::vector<std::string>& names,
                         double scale, const Progress& progress) {
  double done = 0;
  for (const std::string& name : names) {
    const auto property = std::find_if(scan.properties.begin(), scan.properties.end(),
                                       [&](const ScalarProperty& p) { return p.name == name; });
    if (property == scan.properties.end() || layer_kind(name) != LayerKind::kUser) {
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

}  // namespace rbvh
