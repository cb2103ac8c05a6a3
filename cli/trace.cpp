// rbvh trace: casts the rays of a .npy file and writes what they hit.
#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <future>
#include <memory>
#include <numbers>

#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/exact_options.h"
#include "cli/stages.h"
#include "io/output_file.h"
#include "io/ray_file.h"
#include "pipeline/device/open_meanwhile.h"

namespace rbvh {
namespace {

double parse_cone(std::string_view text) {
  const double degrees = parse_between(text, 0, 180);
  if (degrees == 180) throw Error(ErrorKind::kUsage, "", "180 degrees are no cone");
  return degrees;
}

struct TraceOptions {
  std::string file, rays;
  std::vector<std::string> levels;
  ExactOptions exact;
  std::optional<double> cone;  // degrees
  ProxyCastOptions proxies;
  bool any = false, shifted = false;
};

void run_trace(Context& context, const TraceOptions& options) {
  const ExactConfig exact = exact_config(options.exact.tracer, options.exact.builder);
  if ((options.levels == std::vector<std::string>{"auto"}) != options.cone.has_value())
    throw Error(ErrorKind::kUsage, "", "--level auto and --cone go together");
  check_proxy_options(options.proxies, {options.file});
  check_paths_differ(context, {options.file, options.rays}, {context.output});
  check_output(context.output, context.force);
  NpyReader rays = open_rays(options.rays);
  std::future<Device> opening = open_meanwhile(context.device);
  const Asset asset = load(context, options.file, {.levels = options.levels});
  const Vec3d shift = given_shift(asset, options.shifted);
  if (const double step = coarse_step(rays, asset, shift); step > 0)
    warn(context, fmt::format("{}: rays are float32, whose steps are {:.2g} wide at these coordinates; save "
                              "them as float64, or use --coordinates shifted",
                              options.rays, step));
  check_exact_options(options.exact, exact, asset);
  if (options.cone && !asset.rbvh())
    throw Error(ErrorKind::kUsage, options.file, "--cone chooses among a pair's levels, and this is no pair");
  const std::string level = levels_to_cast(context, asset, options.levels, true).front();
  check_leaf_numbers(asset, level);
  check_budget(context.memory, ray_stream_bytes(rays.rows()), options.rays, "its rays and hits");
  SceneConfig config = options.proxies.scene;
  config.exact = exact;
  check_tracer_budget(context.memory, asset, config);
  time_phase(context, "load");

  const Device device = opening.get();
  const auto spread = static_cast<float>(2 * std::tan(options.cone.value_or(0) * std::numbers::pi / 360));
  const std::unique_ptr<Tracer> tracer = make_tracer(device, asset, level, config, spread);
  device.finish();
  time_phase(context, "upload");

  const RayTableCounts counts =
      cast_ray_file(*tracer, rays, shift, options.any ? RayQuery::kAny : RayQuery::kNearest, context.output,
                    context.force, context.progress.callback());
  const double trace_seconds = time_phase(context, "trace");
  if (counts.unusable > 0)
    warn(context, options.rays + ": " + counted(counts.unusable, "ray") +
                      " not finite or without a direction; taken for misses");
  report_device(context, device);
  if (asset.scan()) report_exact(context, exact);
  report_proxies(context, *tracer);
  context.report["timings"]["cast"] = counts.seconds;
  context.report["counts"] = {{"rays", counts.rays},
                              {"hits", counts.hits},
                              {"unusable_rays", counts.unusable},
                              {"mrays_per_second", mrays_per_second(counts.rays, trace_seconds)}};
  context.report["bytes"] = counts.rays * kHitColumns * sizeof(float);
  context.report["level"] = level;
}

}  // namespace

void add_trace(CLI::App& app, Context& context) {
  const auto [stage, options] = add_stage(app, context,
                                          {"trace", "Cast rays from a .npy file, for scripts",
                                           "rbvh trace dragon.rbvh --rays rays.npy -o hits.npy"},
                                          kWithOutput | kWithDevice | kWithReport, run_trace);
  stage->add_option("FILE", options->file, "an .rbvh pair, a scan, a proxy or a scene (.json)")->required();
  stage
      ->add_option("--rays", options->rays,
                   "N x 6 or N x 8 float32 or float64: origin, direction, [tmin, tmax] (-: standard input). "
                   "Out come N x 8: t, "
                   "normal, u, v, leaf (-1: none), flags (1: back face, 2: triangle or disc)")
      ->required()
      ->type_name("FILE");
  stage->add_flag("--any", options->any, "any hit instead of the nearest: faster, for visibility");
  add_level_option(*stage, options->levels, false);
  add_parsed(*stage, "--cone", options->cone, parse_cone, "DEG",
             "with --level auto: how wide rays are, full angle; each sees the coarsest level whose texels it "
             "covers");
  add_exact_options(*stage, options->exact);
  add_coordinates_option(*stage, options->shifted);
  add_proxy_options(*stage, options->proxies, false);
}

}  // namespace rbvh
