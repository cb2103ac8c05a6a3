#include <algorithm>

#include "pipeline/base/error.h"
#include "pipeline/light/bake_layer.h"
#include "pipeline/rbvh/check_rbvh.h"
#include "pipeline/rbvh/layer_painting.h"
#include "pipeline/rbvh/layer_sampling.h"
#include "pipeline/trace/make_tracer.h"
#include "rbvh/layers.h"

namespace rbvh {
namespace {

Rbvh& pair_of(const Asset& asset) {
  Rbvh* rbvh = asset.rbvh();
  if (rbvh == nullptr) throw Error(ErrorKind::kUsage, asset.path, "is no .rbvh pair, and has no layers");
  return *rbvh;
}

const Level& level_of(const Asset& asset, const std::string& name) {
  const Rbvh& rbvh = pair_of(asset);
  return *rbvh.find_level(
      choose_levels(asset, name.empty() ? std::vector<std::string>{} : std::vector{name}).front());
}

std::vector<std::string> levels_of(const Asset& asset, const std::vector<std::string>& names) {
  pair_of(asset);
  return choose_levels(asset, names.empty() ? std::vector<std::string>{"all"} : names);
}

}  // namespace

void check_layer_name(std::string_view name) {
  if (!is_name(std::string(name)))
    throw Error(ErrorKind::kUsage, "",
                "'" + std::string(name) + "' is no layer's name: 1 to 32 letters, digits, _ and -");
}

std::vector<std::string> layer_names(const Asset& pair, const std::string& level) {
  std::vector<std::string> names;
  for (const Layer& layer : level_of(pair, level).layers)
    if (layer_kind(layer.name) == LayerKind::kUser) names.push_back(layer.name);
  return names;
}

LayerValues sample_pair(const Device& device, const Asset& pair, const std::string& layer,
                        std::span<const Vec3f> points, const std::string& level, std::optional<float> reach) {
  const Level& from = level_of(pair, level);
  const Layer values = layer_to_sample(from, layer, pair.path);
  return {sample_layer(make_point_index(device, from), from, values, points,
                       reach.value_or(default_reach(pair_of(pair)))),
          sample_width(values)};
}

std::uint64_t paint_pair(const Device& device, const Asset& pair, std::span<const Vec3f> points,
                         std::span<const float> values, std::size_t width, const PaintConfig& config) {
  if (width < 1 || width > 4 || values.size() != points.size() * width)
    throw Error(ErrorKind::kUsage, pair.path, "a row of 1 to 4 values is wanted for each point");
  check_layer_name(config.layer);
  if (const LayerKind kind = layer_kind(config.layer); kind != LayerKind::kUser && kind != LayerKind::kColor)
    throw Error(ErrorKind::kUsage, pair.path, "the layer " + config.layer + " cannot be painted");
  std::uint64_t missed = 0;
  for (const auto& [level, counts] : paint_levels(
           device, pair_of(pair), levels_of(pair, config.levels),
           {config.layer, points, values, width, config.scale, config.radius, config.reach}, pair.path))
    missed = std::max(missed, counts.points_missed);
  return missed;
}

std::vector<BakedLevel> bake_pair(const Device& device, const Asset& pair, const BakeLayer& bake,
                                  const Environment& environment, const PathConfig& config,
                                  const std::vector<std::string>& levels, const Progress& progress) {
  check_layer_name(bake.name);
  std::vector<BakedLevel> baked;
  PathConfig paths = config;
  const std::vector<std::string> chosen = levels_of(pair, levels);
  for (Level& level : pair_of(pair).levels) {
    if (std::find(chosen.begin(), chosen.end(), level.name) == chosen.end()) continue;
    paths.offset = path_offset(pair, level.name, level.name);
    const auto tracer = make_tracer(device, pair, level.name, {});
    baked.emplace_back(level.name,
                       bake_layer(device, *tracer, level, bake, environment, paths, pair.path, progress));
  }
  return baked;
}

}  // namespace rbvh
