#include "pipeline/rbvh/build_options.h"

#include <nlohmann/json.hpp>

#include "pipeline/base/words.h"

namespace rbvh {
namespace {

template <class T, std::size_t N>
std::string_view name_of(const std::pair<std::string_view, T> (&choices)[N], T value) {
  for (const auto& [name, choice] : choices)
    if (choice == value) return name;
  return {};
}

}  // namespace

std::vector<WantedLevel> parse_wanted_levels(std::string_view text) {
  std::vector<WantedLevel> levels;
  for (const std::string& word : parse_list(text)) {
    const std::size_t equals = word.find('=');
    WantedLevel& level = levels.emplace_back(WantedLevel{word.substr(0, equals), {}});
    if (equals != std::string::npos) level.error = parse_above_zero(word.substr(equals + 1));
  }
  return levels;
}

std::string build_options_json(const BuildConfig& config, const std::optional<FocusWords>& focus,
                               const LayerWords& layers) {
  nlohmann::ordered_json json;
  json["refinement"] = name_of(kRefinements, config.refinement);
  json["split"] = name_of(kSplitRules, config.split);
  json["partition"] = name_of(kPartitionPlaces, config.partition);
  json["rays"] = name_of(kRayKinds, config.rays);
  if (focus) {
    json[focus->is_camera ? "focus_camera" : "focus"] = {focus->point.x, focus->point.y, focus->point.z};
    if (focus->radius) json["focus_radius"] = *focus->radius;
    json["focus_level"] = focus->level.name;
  }
  json["hybrid"] = name_of(kHybrids, config.hybrid);
  for (const LevelConfig& level : config.levels) json["levels"].push_back(level.name);
  if (!layers.names.empty()) json["layers"] = layers.names;
  if (!layers.names.empty() && layers.scale != 1) json["layer_scale"] = layers.scale;
  if (config.color_scale) json["color_scale"] = *config.color_scale;
  return json.dump();
}

}  // namespace rbvh
