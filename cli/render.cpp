// rbvh render: previews of pairs, scans, proxies and scenes, ray cast.
#include "cli/asset_options.h"
#include "cli/camera_options.h"
#include "cli/common.h"
#include "cli/exact_options.h"
#include "cli/light_options.h"
#include "cli/look_options.h"
#include "cli/stages.h"
#include "io/cameras_file.h"
#include "io/file_pictures.h"
#include "pipeline/light/light_words.h"

namespace rbvh {
namespace {

struct RenderOptions {
  PictureJob job;  // but for what follows
  CameraOptions camera;
  ExactOptions exact;
  std::vector<ExactTraversal> compared;  // none, or two tracers
  ProxyCastOptions proxies;
  LightOptions light;
  const CLI::App* stage = nullptr;
};

int parse_samples(std::string_view text) { return parse_integer_between(text, 1, 1 << 20); }

// Options that the pictures asked for have no use for.
void check_use(const RenderOptions& options) {
  const Aov aov = options.job.shown.aov;
  const bool has_color_layer = !options.job.look.colored.name.empty();
  if (!options.light.cached.empty() && (aov != Aov::kShaded || has_color_layer))
    throw Error(ErrorKind::kUsage, "", "--cached is for shaded pictures in their own colours");
  if (aov != Aov::kShaded && !is_of_light(aov) &&
      (options.job.shown.samples > 0 || has_color_layer || !options.light.words.light.empty()))
    throw Error(ErrorKind::kUsage, "",
                "--samples, --light and --color-layer are for shaded and lit pictures");
  if (options.job.look.edges && kind_of(aov) == Image::Kind::kData)
    throw Error(ErrorKind::kUsage, "", "--edges are drawn in colours; depth and position are data");
  check_proxy_options(options.proxies, options.job.files);
}

std::vector<ExactConfig> exact_configs(const RenderOptions& options) {
  if (options.compared.empty()) return {exact_config(options.exact.tracer, options.exact.builder)};
  std::vector<ExactConfig> configs;
  for (const ExactTraversal tracer : options.compared)
    configs.push_back(exact_config(tracer, options.exact.builder));
  return configs;
}

PictureJob job_of(Context& context, const RenderOptions& options) {
  PictureJob job = options.job;
  job.exact = exact_configs(options);
  job.output = context.output;
  job.overwrite = context.force;
  job.device = context.device;
  job.memory = context.memory;
  job.cameras = options.camera;
  job.cameras.words = {options.camera.given};
  if (!options.camera.cameras_path.empty())
    job.cameras.words = read_cameras(options.camera.cameras_path, options.camera.given);
  job.shown.width = options.camera.resolution.width;
  job.shown.height = options.camera.resolution.height;
  job.scene = options.proxies.scene;
  job.tessellate = options.proxies.tessellate;
  check_paths_differ(context, job.files, {context.output});
  check_use(options);
  if (job.shown.aov == Aov::kOcclusion) refuse_for_occlusion(*options.stage);
  LightOptions light = options.light;
  prepare_light(context, light, is_of_light(job.shown.aov));
  job.lighting = light;
  job.secondary_level = light.bounce_level;
  return job;
}

void check_asset(Context& context, const RenderOptions& options, const PictureJob& job, const Asset& asset) {
  warn_of_textures(context, asset);
  if (!asset.scan() && !options.compared.empty())
    throw Error(ErrorKind::kUsage, asset.path,
                std::string("--compare is for scans; this is a ") + (asset.rbvh() ? "pair" : "scene"));
  for (const ExactConfig& config : job.exact) check_exact_options(options.exact, config, asset);
  note_ignored_levels(context, asset, job.levels);
}

void say_picture(Context& context, const Asset& asset, const Picture& picture,
                 const std::string& text_fault) {
  if (picture.path_samples > 0)
    context.report["paths"] = {{"samples", picture.path_samples}, {"noise", picture.noise}};
  if (picture.is_empty)
    warn(context, asset.path + ": nothing is in view; the object's bounds and shift are in rbvh info");
  if (!text_fault.empty())
    warn(context, "pictures have no text: " + text_fault + "; name one with --font-file");
}

PictureObserver observer_of(Context& context, const RenderOptions& options, const PictureJob& job) {
  return {
      .progress = context.progress.callback(),
      .on_phase = [&](std::string_view phase, double seconds) { add_time(context, phase, seconds); },
      .on_loaded = [&](const Asset& asset) { check_asset(context, options, job, asset); },
      .on_started =
          [&](const Asset& asset, const Device& device) {
            report_device(context, device);
            if (asset.scan()) report_exact(context, job.exact[0]);
            if (job.exact.size() > 1) context.report["compared_with"] = info(job.exact[1].traversal).name;
            if (!asset.rbvh() && !job.secondary_level.empty())
              note(context, "rbvh render: " + asset.path + " has no levels; --bounce-level is ignored");
          },
      .on_view =
          [&](const Asset& asset, const PlacedCameras& placed) {
            context.report["views"].push_back({{"file", asset.path}, {"view", placed.text}});
            if (job.look.view == View::kChosen)
              note(context, "rbvh render: " + asset.path + ": " + placed.text);
          },
      .on_picture = [&](const Asset& asset, const Picture& picture,
                        const std::string& text_fault) { say_picture(context, asset, picture, text_fault); },
      .on_written =
          [&](const std::string& name, std::uint64_t bytes) {
            context.report["outputs"].push_back({{"file", name}, {"bytes", bytes}});
            detail(context, "rbvh render: wrote " + name);
          },
      .on_level = [&](const Tracer& tracer) { report_proxies(context, tracer); }};
}

void run_render(Context& context, const RenderOptions& options) {
  const PictureJob job = job_of(context, options);
  FilePictures pictures(job, observer_of(context, options, job));
  for_each_file(context, job.files, [&](const std::string& path) { pictures.draw(path); });
  pictures.finish();
  const PictureCounts& counts = pictures.counts();
  const RenderTimings& timings = counts.timings;
  auto& report = context.report;
  report["timings"]["trace"] = timings.trace;
  report["timings"]["shade"] = timings.shade;
  report["counts"] = {{"images", report["outputs"].size()},
                      {"rays", timings.rays},
                      {"mrays_per_second", mrays_per_second(timings.rays, timings.trace)}};
  if (!options.compared.empty()) {
    report["counts"]["differing_pixels"] = counts.differing;
    note(context, "rbvh render: " + counted(counts.differing, "differing pixel"));
  }
  report["bytes"] = counts.bytes;
}

}  // namespace

void add_render(CLI::App& app, Context& context) {
  const auto [stage, options] = add_stage(app, context,
                                          {"render", "Ray cast previews of pairs, scans, proxies and scenes",
                                           "rbvh render dragon.rbvh -o '{name}-{level}.png' --level all"},
                                          kWithOutput | kWithDevice | kWithReport, run_render);
  options->stage = stage;
  stage->add_option("FILE", options->job.files, ".rbvh pairs, scans, proxies or scenes (.json)")->required();
  add_level_option(*stage, options->job.levels, true);
  add_parsed(*stage, "--aov", options->job.shown.aov, parse_aov, "WHAT",
             "shaded (default), normal, depth, position, leaf, steps; of light: ao, albedo, shadow, direct, "
             "indirect; "
             "depth and position go to .exr");
  add_exact_options(*stage, options->exact);
  add_parsed(
      *stage, "--samples", options->job.shown.samples, parse_samples, "N",
      "rays a pixel of a shaded picture (default: 16 of small ones, else 4; with --light 64 paths); with "
      "--quick 1 is the centre");
  add_camera_options(*stage, options->camera);
  add_look_options(*stage, options->job.look);
  add_parsed(*stage, "--compare", options->compared, parse_two_traversals, "A,B",
             "where two tracers' hits differ, instead of a picture of the scan")
      ->excludes("--aov")
      ->excludes("--tracer")
      ->excludes("--samples")
      ->excludes("--color-layer");
  add_coordinates_option(*stage, options->job.shifted);
  add_proxy_options(*stage, options->proxies, true);
  add_light_options(*stage, options->light);
}

}  // namespace rbvh
