#include "pipeline/rbvh/lod.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/layer_codec.h"
#include "pipeline/rbvh/layer_sampling.h"
#include "pipeline/rbvh/layers.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/level_surface.h"
#include "pipeline/rbvh/texel.h"

namespace rbvh {
namespace {

/// A texel's disc extends past the middle between it and its diagonal neighbours.
constexpr double kDiscPerTexel = 0.75;
/// A surface that is inclined to the tile stretches its texels; at most by this factor.
constexpr double kMostStretch = 3;

/// Collects the vertices of one level's surface.
class SurfaceScan {
 public:
  explicit SurfaceScan(const Level& level)
      : normals_(find_layer(level, "normal")), colors_(find_layer(level, "color")) {}

  /// The texel's point, with its normal and colour in the layers.
  std::uint32_t add_texel(Vec3f point, std::size_t texel, Vec3f otherwise_normal) {
    const bool is_known = normals_ != nullptr && normals_->texels[texel] != 0;
    return add(point, is_known ? unpack_normal(normals_->texels[texel]) : otherwise_normal, texel);
  }

  void add_vertex(const Scan& primitives, std::uint32_t vertex) {
    scan.positions.push_back(primitives.positions[vertex]);
    scan.normals.push_back(primitives.normals[vertex]);
    if (colors_ != nullptr)
      scan.colors.push_back(primitives.colors.empty() ? Color8{} : primitives.colors[vertex]);
  }

  Scan scan;

 private:
  std::uint32_t add(Vec3f point, Vec3f normal, std::size_t texel) {
    scan.positions.push_back(point);
    scan.normals.push_back(normal);
    if (colors_ != nullptr) {
      const Vec3f c = unpack_srgb(colors_->texels[texel]) * 255.0f + Vec3f{0.5f, 0.5f, 0.5f};
      scan.colors.push_back(
          {static_cast<std::uint8_t>(c.x), static_cast<std::uint8_t>(c.y), static_cast<std::uint8_t>(c.z)});
    }
    return static_cast<std::uint32_t>(scan.positions.size() - 1);
  }

  const Layer* normals_;
  const Layer* colors_;
};

void add_quads(const Level& level, SurfaceScan& surface) {
  const std::vector<std::uint16_t>& heights = level.layers[0].texels;
  constexpr std::uint32_t kNone = 0xffffffffu;
  std::vector<std::uint32_t> vertices;
  std::uint32_t current = kNone;
  for_each_quad(level, [&](std::uint32_t k, std::uint32_t x, std::uint32_t y, std::size_t texel) {
    const RbvhLeaf& leaf = level.leaves[k];
    if (k != current) {
      current = k;
      vertices.assign(std::size_t{leaf.width} * leaf.height, kNone);
    }
    const TileFrame frame(leaf);
    const auto vertex = [&](std::uint32_t i, std::uint32_t j) {
      std::uint32_t& v = vertices[(y + j) * leaf.width + x + i];
      const std::size_t at = texel + j * level.atlas_width + i;
      if (v == kNone)
        v = surface.add_texel(frame.at(x + i, y + j, heights[at]), at, Vec3f(normalized(frame.w)));
      return v;
    };
    const std::uint32_t a = vertex(0, 0), b = vertex(1, 0), c = vertex(0, 1), d = vertex(1, 1);
    surface.scan.triangles.push_back({a, b, d});
    surface.scan.triangles.push_back({a, d, c});
  });
}

void add_texel_discs(const Level& level, SurfaceScan& surface) {
  const std::vector<std::uint16_t>& heights = level.layers[0].texels;
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  for (const RbvhNode& node : level.nodes) {
    if (node.count == 0 || firsts[node.first] != RBVH_NO_LEAF) continue;
    const RbvhLeaf& leaf = level.leaves[node.first];
    const TileFrame frame(leaf);
    const Vec3d outside = normalized(frame.w);
    for (std::uint32_t y = 0; y < leaf.height; ++y)
      for (std::uint32_t x = 0; x < leaf.width; ++x) {
        const std::size_t at = (std::size_t{leaf.y} + y) * level.atlas_width + leaf.x + x;
        if (heights[at] == 0) continue;
        const Vec3f p = frame.at(x, y, heights[at]);
        bool is_inside = true;
        for (int axis = 0; axis < 3; ++axis)
          is_inside = is_inside && p[axis] >= node.lo[axis] && p[axis] <= node.hi[axis];
        if (!is_inside) continue;
        surface.add_texel(p, at, Vec3f(outside));
        const double lean = std::abs(dot(Vec3d(surface.scan.normals.back()), outside));
        surface.scan.radii.push_back(static_cast<float>(
            kDiscPerTexel * std::max(length(frame.u), length(frame.v)) / std::max(lean, 1 / kMostStretch)));
      }
  }
}

/// A mesh has triangles, a cloud discs.
void add_primitives(const Level& level, bool is_cloud, SurfaceScan& surface) {
  if (holds_discs(level) != is_cloud) return;
  const Scan& from = level.primitives;
  const auto first = static_cast<std::uint32_t>(surface.scan.positions.size());
  for (std::uint32_t i = 0; i < from.positions.size(); ++i) surface.add_vertex(from, i);
  for (const Triangle& t : from.triangles)
    surface.scan.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  surface.scan.radii.insert(surface.scan.radii.end(), from.radii.begin(), from.radii.end());
}

/// The user's layers of the finer level, sampled at the derived levels' texels.
void carry_layers(const Device& device, const Level& from, std::vector<Level>& derived) {
  const auto is_users = [](const Layer& layer) { return layer_kind(layer.name) == LayerKind::kUser; };
  if (std::none_of(from.layers.begin(), from.layers.end(), is_users)) return;
  const PointIndex index = make_point_index(device, from);
  for (const Layer& layer : from.layers) {
    if (!is_users(layer)) continue;
    double own = 0, heights = 0;
    for (std::size_t i = 0; i < from.leaves.size(); ++i) {
      own += layer_tile(from, layer, i).width - 1;
      heights += from.leaves[i].width - 1;
    }
    for (Level& level : derived) {
      Layer& to = level.layers.emplace_back(make_layer(level, layer.name, layer.channels, own / heights));
      const LayerPoints points = layer_points(level, to);
      const auto most = static_cast<float>(2 * texel_side(level));
      set_values(to, points.texels, sample_layer(index, from, layer, points.points, most));
    }
  }
}

bool is_in(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::string three_digits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

}  // namespace

Scan scan_of_level(const Level& level, bool is_cloud) {
  SurfaceScan surface(level);
  if (is_cloud)
    add_texel_discs(level, surface);
  else
    add_quads(level, surface);
  add_primitives(level, is_cloud, surface);
  return std::move(surface.scan);
}

std::vector<Level> derive_levels(const Device& device, const Rbvh& rbvh, const Level& from,
                                 const std::vector<LevelConfig>& levels, const Progress& progress) {
  const bool is_cloud = rbvh.source.triangles == 0;
  const Scan scan = scan_of_level(from, is_cloud);
  if (scan.positions.empty() || scan.is_cloud() != is_cloud)
    throw Error(ErrorKind::kInput, "", "level " + from.name + " has no surface to derive another from");
  BuildConfig config;
  config.levels = levels;
  config.area = rbvh.source.area;
  std::vector<Level> derived = build_rbvh(device, scan, config, progress).levels;
  for (Level& level : derived) level.derived_from = from.name;
  carry_layers(device, from, derived);
  return derived;
}

std::vector<LevelConfig> derivable_levels(const Rbvh& rbvh, const Level& than) {
  std::vector<LevelConfig> configs;
  for (const LevelConfig& config : standard_levels())
    if (rbvh.find_level(config.name) == nullptr && config.rho < than.rho) configs.push_back(config);
  return configs;
}

void add_derived_levels(const Device& device, Rbvh& rbvh, const Level& from,
                        const std::vector<LevelConfig>& levels, const Progress& progress) {
  if (levels.empty()) return;
  std::vector<Level> derived = derive_levels(device, rbvh, from, levels, progress);
  std::move(derived.begin(), derived.end(), std::back_inserter(rbvh.levels));
  std::stable_sort(rbvh.levels.begin(), rbvh.levels.end(),
                   [](const Level& a, const Level& b) { return a.rho > b.rho; });
}

LevelChoice choose_levels_by_name(const Rbvh& rbvh, const std::vector<std::string>& wanted,
                                  const std::vector<std::string>& dropped, const std::string& file) {
  LevelChoice choice;
  for (const Level& level : rbvh.levels)
    if (wanted.empty() || is_in(wanted, level.name)) choice.names.push_back(level.name);
  if (!wanted.empty())
    for (const LevelConfig& config : derivable_levels(rbvh, rbvh.levels.front()))
      if (is_in(wanted, config.name)) {
        choice.derived.push_back(config);
        choice.names.push_back(config.name);
      }
  const auto refuse = [&](const std::string& name) {
    throw Error(ErrorKind::kUsage, file,
                "there is no level '" + name + "'; there are " + level_names(rbvh) +
                    ", and standard levels coarser than the finest of them can be derived");
  };
  for (const std::string& name : dropped)
    if (rbvh.find_level(name) == nullptr) refuse(name);
  for (const std::string& name : wanted)
    if (!is_in(choice.names, name)) refuse(name);
  std::erase_if(choice.names, [&](const std::string& name) { return is_in(dropped, name); });
  if (choice.names.empty()) throw Error(ErrorKind::kUsage, file, "no level would be left");
  return choice;
}

std::string level_names(const Rbvh& rbvh) {
  std::string names;
  for (const Level& level : rbvh.levels) names += (names.empty() ? "" : ", ") + level.name;
  return names;
}

void keep_levels(Rbvh& rbvh, const std::vector<std::string>& names) {
  std::erase_if(rbvh.levels, [&](const Level& level) { return !is_in(names, level.name); });
}

std::vector<std::string> unmeasured_levels(const Rbvh& rbvh) {
  std::vector<std::string> names;
  for (const Level& level : rbvh.levels)
    if (std::isnan(error_percent(level.fidelity))) names.push_back(level.name);
  return names;
}

std::string choose_level_by_error(const Rbvh& rbvh, double most, const std::string& file) {
  const std::vector<std::string> unmeasured = unmeasured_levels(rbvh);
  if (!unmeasured.empty())
    throw Error(ErrorKind::kInput, file, "level " + unmeasured[0] + " was not measured");
  const Level* chosen = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const Level& level : rbvh.levels) {  // finest first: the last one is the smallest
    const double error = error_percent(level.fidelity);
    least = std::min(least, error);
    if (error <= most) chosen = &level;
  }
  if (chosen == nullptr)
    throw Error(ErrorKind::kBudget, file,
                "no level is within an error of " + three_digits(most) + "% of the diagonal; the best has " +
                    three_digits(least) + "%");
  return chosen->name;
}

std::vector<std::size_t> choose_levels_by_bytes(std::span<const std::uint64_t> bytes, std::uint64_t most) {
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    if (bytes[i] > most) continue;
    most -= bytes[i];
    chosen.push_back(i);
  }
  return chosen;
}

}  // namespace rbvh
