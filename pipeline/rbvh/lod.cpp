#include "pipeline/rbvh/lod.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/build_tuning.h"
#include "pipeline/rbvh/layer_codec.h"
#include "pipeline/rbvh/layer_sampling.h"
#include "pipeline/rbvh/layers.h"
#include "pipeline/rbvh/level_mesh.h"
#include "pipeline/rbvh/texture_layer.h"

namespace rbvh {
namespace {

/// The user's layers of the finer level, sampled at the derived levels' texels.
void carry_layers(const Device& device, const Level& from, std::vector<Level>& derived) {
  const auto is_users = [](const Layer& layer) { return layer_kind(layer.name) == LayerKind::kUser; };
  if (std::none_of(from.layers.begin(), from.layers.end(), is_users)) return;
  const PointIndex index = make_point_index(device, from);
  for (const Layer& layer : from.layers) {
    if (!is_users(layer)) continue;
    const double scale = mean_scale(from, layer);
    for (Level& level : derived) {
      Layer& to = level.layers.emplace_back(make_layer(level, layer.name, layer.channels, scale));
      const LayerPoints points = layer_points(level, to);
      const auto most = static_cast<float>(2 * texel_side(level));
      set_values(to, points.texels, sample_layer(index, from, layer, points.points, most));
      if (&layer == texture_layer(from)) round_texture(to);
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

std::vector<Level> derive_levels(const Device& device, const Rbvh& rbvh, const Level& from,
                                 const std::vector<LevelConfig>& levels, const Progress& progress) {
  const bool is_cloud = rbvh.source.triangles == 0;
  const Scan scan = level_mesh(from, is_cloud);
  if (scan.positions.empty() || scan.is_cloud() != is_cloud)
    throw Error(ErrorKind::kInput, "", "level " + from.name + " has no surface to derive another from");
  BuildConfig config;
  config.levels = levels;
  config.area = rbvh.source.area;
  const BuildTuning tuning{.one_sided = texture_layer(from) != nullptr};
  std::vector<Level> derived = build_tuned(device, scan, config, tuning, progress).levels;
  const double before = known_error(rbvh, from).percent / 100;  // NaN: not known
  for (Level& level : derived) {
    level.derived_from = from.name;
    level.reached =
        std::isnan(before) ? 0 : static_cast<float>(before) + std::max(level.error, level.reached);
  }
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

KnownError known_error(const Rbvh& rbvh, const Level& level) {
  const double measured = error_percent(level.fidelity);
  if (!std::isnan(measured)) return {measured, true};
  const bool is_unbounded = !level.derived_from.empty() && !(level.reached > 0);
  if (rbvh.source.triangles == 0 || !(level.error > 0) || is_unbounded)
    return {std::numeric_limits<double>::quiet_NaN(), false};
  return {100 * static_cast<double>(std::max(level.error, level.reached)), false};
}

const Level& choose_level_by_error(const Rbvh& rbvh, double most, const std::string& file) {
  constexpr double kRounding = 1 + 1e-6;  // levels have theirs in float
  const Level* chosen = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const Level& level : rbvh.levels) {  // finest first: the last one is the smallest
    const double error = known_error(rbvh, level).percent;
    if (std::isnan(error))
      throw Error(ErrorKind::kInput, file,
                  "level " + level.name + " was not measured, and was built for no error", Remedy::kMeasure);
    least = std::min(least, error);
    if (error <= most * kRounding) chosen = &level;
  }
  if (chosen == nullptr)
    throw Error(ErrorKind::kBudget, file,
                "no level is within an error of " + three_digits(most) + "% of the diagonal; the best has " +
                    three_digits(least) + "%");
  return *chosen;
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
