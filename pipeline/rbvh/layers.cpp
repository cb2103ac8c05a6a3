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

constexpr std::size_t kGrain = 1 << 12, kLeafGrain = 16;
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

double mean_scale(const Level& level, const Layer& layer) {
  double own = 0, heights = 0;
  for (std::size_t i = 0; i < level.leaves.size(); ++i) {
    own += layer_tile(level, layer, i).width - 1;
    heights += level.leaves[i].width - 1;
  }
  return own / heights;
}

LayerPoints layer_points(const Level& level, const Layer& layer) {
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  std::vector<LayerPoints> of_leaves(level.leaves.size());
  parallel_for(level.leaves.size(), kLeafGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const auto leaf = static_cast<std::uint32_t>(k);
      const LeafSurface surface(level, leaf, firsts[k]);
      const LayerGrid grid(level, layer, leaf);
      for (int y = 0; y < grid.tile.height; ++y)
        for (int x = 0; x < grid.tile.width; ++x) {
          const float u = static_cast<float>(x) / grid.per_u, v = static_cast<float>(y) / grid.per_v;
          // Coarse texels extend past the heights' border, as fine ones do: reads there use all four.
          const float side = std::max(1 / grid.per_u, 1 / grid.per_v);
          const std::optional<Vec3f> point = surface.point(u, v, side > 1 ? 1.5f * side : 0);
          if (!point) continue;
          of_leaves[k].texels.push_back(grid.texel(x, y));
          of_leaves[k].points.push_back(*point);
        }
    }
  });
  LayerPoints result;
  for (LayerPoints& some : of_leaves) {
    result.texels.insert(result.texels.end(), some.texels.begin(), some.texels.end());
    result.points.insert(result.points.end(), some.points.begin(), some.points.end());
    some = {};
  }
  return result;
}

NearestPlaces::NearestPlaces(const Scan& scan) : scan_(scan) {
  TriangleSoup soup;
  const auto add = [&](std::size_t element, const Triangle& t) {
    for (const std::uint32_t i : t)
      if (!is_finite(scan.positions[i])) return;
    elements_.push_back(static_cast<std::uint32_t>(element));
    for (const std::uint32_t i : t) soup.push_back(scan.positions[i]);
  };
  for (std::size_t i = 0; i < scan.triangles.size(); ++i) add(i, scan.triangles[i]);
  if (scan.is_cloud())  // its points as degenerate triangles
    for (std::uint32_t i = 0; i < scan.positions.size(); ++i) add(i, {i, i, i});
  closest_.emplace(std::move(soup));
}

std::optional<NearestPlaces::Place> NearestPlaces::find(Vec3f point) const {
  const ClosestPoint::Nearest nearest = closest_->find(point);
  if (!std::isfinite(nearest.distance)) return {};
  Place place{.element = elements_[nearest.triangle]};
  if (scan_.is_cloud()) return place;
  const Triangle& t = scan_.triangles[place.element];
  const Vec3f a = scan_.positions[t[0]], ab = scan_.positions[t[1]] - a, ac = scan_.positions[t[2]] - a,
              ap = nearest.point - a, n = cross(ab, ac);
  const float area = dot(n, n);
  const float v = area > 0 ? std::clamp(dot(cross(ap, ac), n) / area, 0.0f, 1.0f) : 0;
  const float w = area > 0 ? std::clamp(dot(cross(ab, ap), n) / area, 0.0f, 1.0f) : 0;
  place.weights = {std::max(0.0f, 1 - v - w), v, w};
  return place;
}

std::vector<float> property_at(const Scan& scan, const ScalarProperty& property,
                               std::span<const Vec3f> points) {
  const NearestPlaces places(scan);
  std::vector<float> values(points.size(), kNone);
  parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::optional<NearestPlaces::Place> place = places.find(points[i]);
      if (!place) continue;
      float value = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        if (!(place->weights[c] > 0)) continue;  // a NaN must not spread to where its weight is 0
        const std::uint32_t vertex = scan.is_cloud() ? place->element : scan.triangles[place->element][c];
        value += property.values[vertex] * place->weights[c];
      }
      values[i] = value;
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
