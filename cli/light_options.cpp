#include "cli/light_options.h"

#include <filesystem>

#include "cli/layer_options.h"
#include "cli/parse.h"
#include "io/environment_file.h"
#include "pipeline/base/memory_budget.h"

namespace rbvh {
namespace {

constexpr const char* kGroup = "Light";

Material parse_material(std::string_view text) {
  const std::size_t colon = text.find(':');
  const std::string_view name = text.substr(0, colon);
  const auto value = [&](double fallback, double least, double most) {
    return static_cast<float>(
        colon == std::string_view::npos ? fallback : parse_between(text.substr(colon + 1), least, most));
  };
  Material material;
  if (name == "glossy") {
    material.kind = Material::Kind::kGlossy;
    material.roughness = value(0.3, 0, 1);
  } else if (name == "metal") {
    material.kind = Material::Kind::kMetal;
    material.roughness = value(0.3, 0, 1);
  } else if (name == "glass") {
    material.kind = Material::Kind::kGlass;
    material.ior = value(1.5, 1.01, 4);
    material.color = Vec3f{1, 1, 1};
  } else if (text == "clay") {
    material.color = kClay;
  } else if (text != "matte") {
    throw Error(
        ErrorKind::kUsage, "",
        "'" + std::string(text) + "' is none of matte, clay, glossy:ROUGHNESS, metal:ROUGHNESS, glass:IOR");
  }
  return material;
}

LightWords::Sun parse_sun(std::string_view text) {
  const std::size_t comma = text.find(',');
  if (comma == std::string_view::npos)
    throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not two angles, such as 45,30");
  return {parse_between(text.substr(0, comma), -360, 360),
          parse_between(text.substr(comma + 1), kLowestSun, 90)};
}

double parse_seconds(std::string_view text) {
  return parse_above_zero(text.ends_with('s') ? text.substr(0, text.size() - 1) : text);
}

int parse_bounces(std::string_view text) { return parse_positive_up_to(text, 1000); }
std::uint32_t parse_seed(std::string_view text) {
  return static_cast<std::uint32_t>(parse_positive_up_to(text, 1 << 30));
}
std::string parse_level_name(std::string_view text) { return std::string(text); }

}  // namespace

void add_baked_light_options(CLI::App& stage, LightOptions& options) {
  stage
      .add_option(
          "--light", options.words.light,
          "sky, sun, white, a latitude-longitude map (.exr, .hdr); of pictures also studio and headlight, "
          "and it is what has them lit by paths")
      ->type_name("LIGHT")
      ->group(kGroup);
  const auto declare = [&](CLI::Option* option) { options.declared.push_back(option->group(kGroup)); };
  declare(add_parsed(
      stage, "--sun-direction", options.words.sun, parse_sun, "AZIMUTH,ELEVATION",
      "degrees: to the left of the front, seen from above, and over the horizon (default: 45,45)"));
  declare(add_parsed(stage, "--material", options.paths.material, parse_material, "WHAT",
                     "matte (default), clay (no colours), glossy:ROUGHNESS, metal:ROUGHNESS or glass:IOR"));
  declare(stage.add_flag("--ground", options.ground, "shadows fall on the plane below the object"));
  declare(add_parsed(stage, "--bounces", options.paths.max_bounces, parse_bounces, "N",
                     "a path's vertices at most; 1: direct light alone (default: 64)"));
  declare(add_parsed(stage, "--ao-distance", options.distance, parse_above_zero, "D",
                     "ao sees what lies so near, scan units (default: all)"));
  declare(add_parsed(stage, "--seed", options.paths.seed, parse_seed, "N", "other noise"));
}

void add_light_options(CLI::App& stage, LightOptions& options) {
  add_baked_light_options(stage, options);
  const auto declare = [&](CLI::Option* option) { options.declared.push_back(option->group(kGroup)); };
  declare(add_parsed(stage, "--bounce-level", options.bounce_level, parse_level_name, "LEVEL",
                     "of a pair: casts shadows and bounces at this level (default: that of the picture)"));
  declare(add_parsed(stage, "--time", options.paths.seconds, parse_seconds, "SECONDS",
                     "a picture takes no more samples after so long"));
  declare(
      stage.add_flag("--denoise", options.paths.denoise, "filters what noise is left, along the surfaces"));
  stage.add_flag("--linear", options.linear, "light as it is, without the filmic curve (as in .exr)")
      ->group(kGroup);
  add_parsed(stage, "--cached", options.cached, parse_layer_name, "LAYER",
             "lights a pair by a layer that rbvh bake made, in place of paths")
      ->group(kGroup)
      ->excludes("--light");
}

void prepare_light(LightOptions& options, bool has_aov, const MemoryBudget& memory) {
  if (options.words.light.empty()) {
    if (!has_aov) refuse_options(options.declared, "", "is for pictures with --light");
    if (!has_aov && options.linear && options.cached.empty())
      throw Error(ErrorKind::kUsage, "", "--linear is for pictures with --light or --cached");
    options.words.light = has_aov ? "studio" : "";
    return;
  }
  if (is_light_name(options.words.light)) return;
  std::error_code code;
  if (!std::filesystem::exists(options.words.light, code))
    throw Error(
        ErrorKind::kUsage, "",
        "--light: '" + options.words.light + "' is none of studio, headlight, sky, sun, white, and no file");
  check_read_budget(memory, options.words.light);
  options.words.map = read_environment_map(options.words.light);
}

}  // namespace rbvh
