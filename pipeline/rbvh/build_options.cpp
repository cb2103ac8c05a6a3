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

template <class T, std::size_t N>
void take_choice(const nlohmann::json& json, const char* key,
                 const std::pair<std::string_view, T> (&choices)[N], T& value) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_string()) return;
  for (const auto& [name, choice] : choices)
    if (name == found->get<std::string>()) value = choice;
}

/// Of the focus, or of the camera's.
std::optional<Vec3d> point_at(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_array() || found->size() != 3) return {};
  for (const auto& value : *found)
    if (!value.is_number()) return {};
  return Vec3d{(*found)[0].get<double>(), (*found)[1].get<double>(), (*found)[2].get<double>()};
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

BuildConfig stored_config(const std::string& options, const Vec3d& shift, bool& lacks_focus) {
  BuildConfig config;
  lacks_focus = false;
  const auto json = nlohmann::json::parse(options, nullptr, false);
  if (!json.is_object()) return config;
  take_choice(json, "refinement", kRefinements, config.refinement);
  take_choice(json, "split", kSplitRules, config.split);
  take_choice(json, "partition", kPartitionPlaces, config.partition);
  take_choice(json, "rays", kRayKinds, config.rays);
  take_choice(json, "hybrid", kHybrids, config.hybrid);
  std::optional<Vec3d> focus = point_at(json, "focus");
  if (!focus) focus = point_at(json, "focus_camera");
  if (!focus) return config;
  const auto radius = json.find("focus_radius"), level = json.find("focus_level");
  lacks_focus = radius == json.end() || !radius->is_number() || !(radius->get<double>() > 0);
  if (lacks_focus) return config;
  config.focus = Focus{.center = Vec3f(*focus - shift),
                       .radius = static_cast<float>(radius->get<double>()),
                       .level = standard_levels().front()};
  for (const LevelConfig& known : standard_levels())
    if (level != json.end() && *level == known.name) config.focus->level = known;
  return config;
}

std::string count_update(const std::string& options) {
  auto json = nlohmann::ordered_json::parse(options, nullptr, false);
  if (!json.is_object()) return options;
  const auto before = json.find("updates");
  const bool is_count = before != json.end() && before->is_number_unsigned();
  json["updates"] = (is_count ? before->get<std::uint64_t>() : 0) + 1;
  return json.dump();
}

}  // namespace rbvh
