// rbvh trace: casts the rays of a .npy file and writes what they hit.
#include <cmath>
#include <memory>
#include <numbers>

#include "cli/common.h"
#include "cli/exact_options.h"
#include "cli/stages.h"
#include "cli/subject.h"
#include "io/npy.h"
#include "io/output_file.h"

namespace rbvh {
namespace {

constexpr std::size_t kRayColumns[] = {6, 8};
constexpr std::size_t kHitColumns = 8;
constexpr std::size_t kBatch = std::size_t{1} << 21;  // rays on the device at once
// Squared lengths outside these would overflow or vanish in the kernels' own arithmetic.
constexpr float kLeastSquare = 1e-20f, kMostSquare = 1e20f;

double parse_cone(std::string_view text) {
  const double angle = parse_number(text);
  if (!(angle >= 0 && angle < 180))
    throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not between 0 and 180 degrees");
  return angle;
}

struct TraceOptions {
  std::string file, rays;
  std::vector<std::string> levels;
  ExactOptions exact;
  std::optional<double> cone;  // degrees
  ProxyCastOptions proxies;
  bool any = false;
};

// A ray as the kernels can take it; t of its hits times `scale` is t as the user has it.
struct PreparedRay {
  Ray ray{};
  float scale = 1;
  bool usable = false;  // finite, with a direction
};

PreparedRay prepare(const float* row, std::size_t columns) {
  PreparedRay p;
  Ray& ray = p.ray;
  std::copy(row, row + 3, ray.origin);
  std::copy(row + 3, row + 6, ray.direction);
  ray.tmin = columns == 8 ? row[6] : 0;
  ray.tmax = columns == 8 ? row[7] : std::numeric_limits<float>::infinity();
  const Vec3d d{static_cast<double>(row[3]), static_cast<double>(row[4]), static_cast<double>(row[5])};
  const double size = length(d);
  p.usable = is_finite(Vec3f{row[0], row[1], row[2]}) && is_finite(d) && size > 0 && !std::isnan(ray.tmin) &&
             !std::isnan(ray.tmax);
  if (p.usable && !(size * size >= kLeastSquare && size * size <= kMostSquare)) {
    for (int axis = 0; axis < 3; ++axis) ray.direction[axis] = static_cast<float>(d[axis] / size);
    ray.tmin = static_cast<float>(ray.tmin * size);
    ray.tmax = static_cast<float>(ray.tmax * size);
    p.scale = static_cast<float>(1 / size);
  }
  if (!p.usable) ray = {{0, 0, 0}, 1, {0, 0, 1}, 0};  // an empty interval: hits nothing
  return p;
}

void store(const Hit& hit, const PreparedRay& ray, float* row) {
  const bool found = ray.usable && std::isfinite(hit.t);
  row[0] = found ? hit.t * ray.scale : std::numeric_limits<float>::infinity();
  for (int axis = 0; axis < 3; ++axis) row[1 + axis] = found ? hit.normal[axis] : 0;
  row[4] = found ? hit.u : 0;
  row[5] = found ? hit.v : 0;
  row[6] = found ? static_cast<float>(hit.leaf) : -1;
  row[7] = found ? static_cast<float>(hit.flags) : 0;
}

void run_trace(Context& context, const TraceOptions& options) {
  const ExactConfig exact = exact_config(options.exact);
  if ((options.levels == std::vector<std::string>{"auto"}) != options.cone.has_value())
    throw Error(ErrorKind::kUsage, "", "--level auto and --cone go together");
  check_proxy_options(options.proxies, {options.file});
  check_paths_differ(context, {options.file, options.rays}, {context.output});
  check_output(context.output, context.force);
  Stopwatch watch;
  check_read_budget(context, options.rays);
  const FloatTable rays = read_npy(options.rays, kRayColumns);
  const Subject subject = load_subject(context, options.file);
  check_exact_options(context, options.exact, exact, subject);
  if (options.cone && !subject.rbvh())
    throw Error(ErrorKind::kUsage, options.file, "--cone chooses among a pair's levels, and this is no pair");
  const std::string level = choose_levels(context, subject, options.levels, true).front();
  check_leaf_numbers(subject, level);
  check_budget(context, std::uint64_t{rays.rows} * (rays.columns + kHitColumns) * sizeof(float), options.rays,
               "its rays and hits");
  SceneConfig config = options.proxies.scene;
  config.exact = exact;
  check_cast_budget(context, subject, config);
  const double load_seconds = watch.lap();

  const Device device = Device::open(context.device);
  const Caster caster =
      make_caster(device, subject, level, config,
                  static_cast<float>(2 * std::tan(options.cone.value_or(0) * std::numbers::pi / 360)));
  device.finish();
  const double upload_seconds = watch.lap();

  std::vector<float> table(rays.rows * kHitColumns);
  const std::size_t batch = std::min(kBatch, std::max<std::size_t>(1, rays.rows));
  Buffer<Ray> ray_buffer(device, batch);
  const Buffer<Hit> hit_buffer(device, batch);
  std::vector<PreparedRay> prepared(batch);
  std::vector<Ray> sent(batch);
  std::vector<Hit> hits(batch);
  std::uint64_t unusable = 0, found = 0;
  double cast_seconds = 0;
  for (std::size_t first = 0; first < rays.rows; first += batch) {
    context.progress.update("trace", static_cast<double>(first) / static_cast<double>(rays.rows));
    const std::size_t count = std::min(batch, rays.rows - first);
    for (std::size_t i = 0; i < count; ++i) {
      prepared[i] = prepare(&rays.values[(first + i) * rays.columns], rays.columns);
      sent[i] = prepared[i].ray;
      unusable += !prepared[i].usable;
    }
    ray_buffer.write(std::span(sent).first(count));
    watch.lap();
    std::visit(
        [&](const auto& tracer) {
          trace_rays(tracer, ray_buffer, hit_buffer, count,
                     options.any ? RayQuery::kAny : RayQuery::kNearest);
        },
        caster);
    device.finish();
    cast_seconds += watch.lap();
    hit_buffer.read(std::span(hits).first(count));
    for (std::size_t i = 0; i < count; ++i) {
      float* row = &table[(first + i) * kHitColumns];
      store(hits[i], prepared[i], row);
      found += row[6] >= 0;
    }
  }
  write_npy(context.output, table, kHitColumns, context.force);
  if (unusable > 0)
    warn(context, options.rays + ": " + counted(unusable, "ray") +
                      " not finite or without a direction; taken for misses");
  context.report["device"] = device_json(device.info());
  if (subject.scan()) report_exact(context, exact);
  report_proxies(context, caster);
  context.report["timings"] = {{"load", load_seconds}, {"upload", upload_seconds}, {"trace", cast_seconds}};
  context.report["counts"] = {{"rays", rays.rows},
                              {"hits", found},
                              {"unusable_rays", unusable},
                              {"mrays_per_second", mrays_per_second(rays.rows, cast_seconds)}};
  context.report["bytes"] = table.size() * sizeof(float);
  context.report["level"] = level;
}

}  // namespace

void add_trace(CLI::App& app, Context& context) {
  const auto options = std::make_shared<TraceOptions>();
  CLI::App* stage = add_stage(app, context,
                              {"trace", "Cast rays from a .npy file, for scripts",
                               "rbvh trace dragon.rbvh --rays rays.npy -o hits.npy"},
                              kWithOutput | kWithDevice | kWithReport,
                              [&context, options] { run_trace(context, *options); });
  stage->add_option("FILE", options->file, "an .rbvh pair, a scan, a proxy or a scene (.json)")->required();
  stage
      ->add_option(
          "--rays", options->rays,
          "N x 6 or N x 8 float32: origin, direction, [tmin, tmax] (-: standard input). Out come N x 8: t, "
          "normal, u, v, leaf (-1: none), flags (1: back face, 2: triangle leaf)")
      ->required()
      ->type_name("FILE");
  stage->add_flag("--any", options->any, "any hit instead of the nearest: faster, for visibility");
  add_level_option(*stage, options->levels, false);
  add_parsed(*stage, "--cone", options->cone, parse_cone, "DEG",
             "with --level auto: how wide rays are, full angle; each sees the coarsest level whose texels it "
             "covers");
  add_exact_options(*stage, options->exact);
  add_proxy_options(*stage, options->proxies, false);
}

}  // namespace rbvh
