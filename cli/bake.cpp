// rbvh bake: light on the surface, kept in a layer.
#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/layer_options.h"
#include "cli/light_options.h"
#include "cli/pair_output.h"
#include "cli/stages.h"
#include "io/rbvh_file.h"
#include "rbvh/layers.h"

namespace rbvh {
namespace {

constexpr std::pair<std::string_view, BakedLight> kBaked[] = {
    {"ao", BakedLight::kOcclusion}, {"sky", BakedLight::kSky}, {"irradiance", BakedLight::kIrradiance}};

struct BakeOptions {
  std::string file;
  std::vector<std::string> levels;
  BakedLight baked = BakedLight::kOcclusion;
  int samples = 64;
  double scale = 1;
  LightOptions light;
  const CLI::App* stage = nullptr;
};

int parse_rays(std::string_view text) { return parse_integer_between(text, 1, 1 << 20); }

void run_bake(Context& context, const BakeOptions& options) {
  check_paths_differ(context, {options.file, atlas_path(options.file)},
                     {context.output, atlas_path(context.output)});
  check_pair_output(context);
  check_is_pair(options.file);
  LightOptions light = options.light;
  if (options.baked == BakedLight::kOcclusion)
    refuse_for_occlusion(*options.stage);
  else
    refuse_options({options.stage->get_option("--ao-distance")}, "", "is for --layer ao");
  if (options.baked == BakedLight::kSky)
    refuse_options({options.stage->get_option("--bounces")}, "", "has no use for sky, which is direct light");
  if (light.words.light == "studio" || light.words.light == "headlight")
    throw Error(ErrorKind::kUsage, "",
                "--light: " + light.words.light + " goes with a camera, and a layer has none");
  if (light.words.light.empty()) light.words.light = "white";
  prepare_light(context, light, true);
  const Asset pair = load(context, options.file);
  const std::vector<std::string> levels = levels_to_cast(context, pair, or_all(options.levels));
  time_phase(context, "load");
  const Device device = open_device(context);
  const Vec3f up = static_cast<Vec3f>(pair.up_axis());
  PathConfig config = light.paths;
  config.samples = options.samples;
  if (light.ground) config.ground = ground_below(pair, up);
  std::uint64_t texels = 0;
  BakeLayer bake{
      .light = options.baked, .scale = options.scale, .distance = static_cast<float>(light.distance)};
  for (const auto& [name, baked] : kBaked)
    if (baked == options.baked) bake.name = name;
  const Environment environment = make_environment(light.words, {}, up);
  for (const auto& [level, lit] :
       bake_pair(device, pair, bake, environment, config, levels, context.progress.callback())) {
    context.report["levels"].push_back({{"name", level}, {"texels", lit}});
    texels += lit;
  }
  time_phase(context, "bake");
  context.report["counts"] = {{"texels", texels}, {"rays_a_texel", options.samples}};
  write_pair(context, context.output, *pair.rbvh(), "layer " + bake.name);
}

}  // namespace

void add_bake(CLI::App& app, Context& context) {
  const auto [stage, options] =
      add_stage(app, context,
                {"bake", "Keep light in a layer of a pair",
                 "rbvh bake dragon.rbvh --layer irradiance --light sky --samples 256 -o lit.rbvh"},
                kWithOutput | kWithDevice | kWithReport, run_bake);
  options->stage = stage;
  stage->add_option("FILE", options->file, "an .rbvh pair")->required();
  add_parsed(*stage, "--layer", options->baked, parse_choice<kBaked>, "LAYER",
             "ao (the part of the sky that is seen), sky (direct light) or irradiance (all)")
      ->required();
  add_parsed(*stage, "--samples", options->samples, parse_rays, "N", "rays or paths a texel (default: 64)");
  add_parsed(*stage, "--layer-scale", options->scale, parse_layer_scale, "S",
             "its texels to one of the heights', 0.0625 to 16 (default: 1)");
  add_baked_light_options(*stage, options->light);
  add_level_option(*stage, options->levels, true);
}

}  // namespace rbvh
