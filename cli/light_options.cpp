#include "cli/light_options.h"

#include "cli/layer_options.h"
#include "io/environment_file.h"
#include "pipeline/light/light_words.h"

namespace rbvh {
namespace {

constexpr const char* kGroup = "Light";

}  // namespace

void add_baked_light_options(CLI::App& stage, LightOptions& options) {
  add_parsed(stage, "--light", options.words.light, parse_light, "LIGHT",
             "sky, sun, white, a latitude-longitude map (.exr, .hdr); of pictures also studio and headlight, "
             "and it is what has them lit by paths")
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
  declare(add_parsed(stage, "--bounce-level", options.bounce_level, parse_name, "LEVEL",
                     "of a pair: casts shadows and bounces at this level (default: that of the picture)"));
  declare(add_parsed(stage, "--time", options.paths.seconds, parse_seconds, "SECONDS",
                     "a picture takes no more samples after so long"));
  declare(
      stage.add_flag("--denoise", options.paths.denoise, "filters what noise is left, along the surfaces"));
  stage.add_flag("--linear", options.linear, "light as it is, without the filmic curve (as in .exr)")
      ->group(kGroup);
  stage.add_flag("--quick", options.quick, "without shadows and occlusion: several times as fast")
      ->group(kGroup)
      ->excludes("--light");
  add_parsed(stage, "--cached", options.cached, parse_name, "LAYER",
             "lights a pair by a layer that rbvh bake made, in place of paths")
      ->group(kGroup)
      ->excludes("--light")
      ->excludes("--quick");
}

void refuse_for_occlusion(const CLI::App& stage) {
  for (const char* name : {"--light", "--sun-direction", "--material", "--ground", "--bounces", "--time",
                           "--denoise", "--linear"})
    if (const CLI::Option* option = stage.get_option_no_throw(name))
      refuse_options({option}, "", "has no use for ao, which is no light");
}

void prepare_light(Context& context, LightOptions& options, bool has_aov) {
  if (!options.words.light.empty()) {
    const std::string note = read_light(options.words, context.memory);
    if (!note.empty()) warn(context, note);
    return;
  }
  if (has_aov) {
    options.words.light = "studio";
    return;
  }
  refuse_options(options.declared, "", "is for pictures with --light");
  if (options.linear && options.quick)
    throw Error(ErrorKind::kUsage, "", "--linear is not for --quick, which has no filmic curve");
}

}  // namespace rbvh
