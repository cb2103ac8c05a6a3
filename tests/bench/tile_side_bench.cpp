// The experiment of the paper's figure 4 (section 3.4): how large should tiles be? For each pixel-to-area
// ratio levels with tiles of no more than so many texels a side are traced; the mean sides within 2% of the
// best rate make an interval, and a logarithm is fitted to the intervals' midpoints. Reports figures;
// passes and fails nothing.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <utility>
#include <vector>

#include "io/scan_io.h"
#include "pipeline/base/error.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/build_tuning.h"
#include "pipeline/trace/trace_exact.h"
#include "pipeline/trace/trace_tile.h"
#include "rbvh/camera.h"
#include "tests/bench/bench_rays.h"

namespace rbvh::bench {
namespace {

constexpr float kSides[] = {6, 8, 11, 16, 22, 32, 45, 64, 90, 128, 180};
constexpr double kPeakShare = 0.98;
constexpr const char* kKinds[] = {"coherent", "incoherent"};

struct Options {
  std::string scan, device;
  int rounds = 9;
  std::uint32_t resolution = 1024;
  SplitRule split = SplitRule::kSpatialMedian;
  bool splits = false;  ///< table 1 instead
};

struct Trial {
  TileTracer tracer;
  double side = 0;  ///< mean of the tiles': the root of their mean texels
  std::size_t leaves = 0;
  std::vector<double>
      rates[2];  ///< against the last trial's, measured right before: other work on the machine cancels
  double rate[2] = {0, 0};  ///< their medians
};

double seconds_of(const Device& device, const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  device.finish();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// a ln(x) + b through the points, least squares.
std::pair<double, double> fit_logarithm(const std::vector<std::pair<double, double>>& points) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const auto& [rho, side] : points) {
    const double l = std::log(rho);
    n += 1, x += l, y += side, xx += l * l, xy += l * side;
  }
  const double a = (n * xy - x * y) / (n * xx - x * x);
  return {a, (y - a * x) / n};
}

/// What all trials are traced with.
struct Rays {
  CameraRays camera;
  Buffer<Hit> camera_hits;
  Buffer<Ray> diffuse;  ///< one bounce from the exact surface
  Buffer<Hit> diffuse_hits;
  std::size_t diffuse_count = 0;
};

Rays make_rays(const Device& device, const Scan& scan, std::uint32_t resolution) {
  const Bounds3f box = bounds(scan);
  const Camera camera = views_around(to_double(box), {0, 1, 0}, 8, 1)[0];
  Rays rays;
  rays.camera = camera_rays(camera, resolution, resolution);
  const std::vector<Ray> first = primary_rays(rays.camera);
  rays.camera_hits = Buffer<Hit>(device, first.size());
  make_exact_tracer(device, scan, {})
      .intersect(Buffer<Ray>(device, first), rays.camera_hits, first.size(), RayQuery::kNearest);
  const std::vector<Ray> diffuse = diffuse_rays(first, rays.camera_hits.read(), 1e-3f * box.diagonal(), 1);
  rays.diffuse = Buffer<Ray>(device, diffuse);
  rays.diffuse_hits = Buffer<Hit>(device, diffuse.size());
  rays.diffuse_count = diffuse.size();
  return rays;
}

Trial build_trial(const Device& device, const Scan& scan, const BuildConfig& config,
                  const BuildTuning& tuning, BuildTimings* timings) {
  const Level built = std::move(build_tuned(device, scan, config, tuning, {}, timings).levels[0]);
  Trial trial;
  double texels = 0;
  for (const RbvhLeaf& leaf : built.leaves) texels += static_cast<double>(leaf.width) * leaf.height;
  trial.tracer = make_tile_tracer(device, built);
  trial.side = std::sqrt(texels / static_cast<double>(built.leaves.size()));
  trial.leaves = built.leaves.size();
  return trial;
}

std::array<double, 2> measure(const Device& device, const Rays& rays, const Trial& trial) {
  return {seconds_of(device, [&] { trial.tracer.intersect(rays.camera, rays.camera_hits); }),
          seconds_of(device, [&] {
            trial.tracer.intersect(rays.diffuse, rays.diffuse_hits, rays.diffuse_count, RayQuery::kNearest);
          })};
}

void measure_all(const Device& device, const Rays& rays, int rounds, std::vector<Trial>& trials,
                 std::size_t reference) {
  for (int round = 0; round <= rounds; ++round)
    for (Trial& trial : trials) {
      const std::array<double, 2> base = measure(device, rays, trials[reference]),
                                  own = measure(device, rays, trial);
      for (std::size_t kind = 0; kind < 2 && round > 0; ++kind)  // the first compiles, warms
        trial.rates[kind].push_back(base[kind] / own[kind]);
    }
  for (Trial& trial : trials)
    for (int kind = 0; kind < 2; ++kind) trial.rate[kind] = median(trial.rates[kind]);
}

/// Table 1: spatial median against surface area heuristic.
void print_splits(const Device& device, const Scan& scan, const Rays& rays, int rounds) {
  std::printf(
      "| level | split | tiles for | nodes | partition [s] | build [s] | primary | diffuse |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- |\n");
  for (const std::size_t level : {0u, 2u, 4u}) {
    std::vector<Trial> trials;
    std::vector<std::array<double, 2>> seconds;
    for (const RaysKind kind : {RaysKind::kCoherent, RaysKind::kIncoherent})
      for (const SplitRule split : {SplitRule::kSpatialMedian, SplitRule::kSurfaceArea}) {
        BuildConfig config;
        config.levels = {standard_levels()[level]};
        config.split = split;
        config.rays = kind;
        BuildTimings timings;
        const auto start = std::chrono::steady_clock::now();
        trials.push_back(build_trial(device, scan, config, {}, &timings));
        const std::chrono::duration<double> all = std::chrono::steady_clock::now() - start;
        seconds.push_back({timings.partition, all.count()});
      }
    measure_all(device, rays, rounds, trials, 0);
    for (std::size_t i = 0; i < trials.size(); ++i)
      std::printf("| %s | %s | %s | %zu | %.2f | %.2f | %.2f | %.2f |\n",
                  standard_levels()[level].name.c_str(), i % 2 == 0 ? "median" : "sah", kKinds[i / 2],
                  2 * trials[i].leaves - 1, seconds[i][0], seconds[i][1], trials[i].rate[0],
                  trials[i].rate[1]);
    std::fflush(stdout);
  }
}

/// The middle of the mean sides whose rates are near the best.
double best_side(const std::vector<Trial>& trials, int kind) {
  double peak = 0, lo = 1e30, hi = 0;
  for (const Trial& trial : trials) peak = std::max(peak, trial.rate[kind]);
  for (const Trial& trial : trials) {
    if (trial.rate[kind] < kPeakShare * peak) continue;
    lo = std::min(lo, trial.side);
    hi = std::max(hi, trial.side);
  }
  return (lo + hi) / 2;
}

/// Figure 4.
void print_sides(const Device& device, const Scan& scan, const Rays& rays, const Options& options) {
  std::printf(
      "| rho | largest side | mean side | leaves | primary | diffuse |\n"
      "| --- | --- | --- | --- | --- | --- |\n");
  std::vector<std::pair<double, double>> middles[2];
  for (const LevelConfig& level : standard_levels()) {
    std::vector<Trial> trials;
    for (const float side : kSides) {
      BuildConfig config;
      config.levels = {level};
      config.split = options.split;
      Trial trial = build_trial(device, scan, config, {.largest_tile = side}, nullptr);
      if (!trials.empty() && trials.back().leaves == trial.leaves) break;  // no tile is that large
      trials.push_back(std::move(trial));
    }
    measure_all(device, rays, options.rounds, trials, trials.size() - 1);
    for (std::size_t i = 0; i < trials.size(); ++i)
      std::printf("| %.0f | %.0f | %.1f | %zu | %.2f | %.2f |\n", static_cast<double>(level.rho),
                  static_cast<double>(kSides[i]), trials[i].side, trials[i].leaves, trials[i].rate[0],
                  trials[i].rate[1]);
    for (int kind = 0; kind < 2; ++kind) middles[kind].emplace_back(level.rho, best_side(trials, kind));
    std::fflush(stdout);
  }
  std::printf("\n| rays | rho: middle of the best mean sides | fit |\n| --- | --- | --- |\n");
  for (int kind = 0; kind < 2; ++kind) {
    std::printf("| %s | ", kKinds[kind]);
    for (const auto& [rho, side] : middles[kind]) std::printf("%.0fk: %.1f; ", rho / 1000, side);
    const auto [a, b] = fit_logarithm(middles[kind]);
    std::printf("| %.2f ln rho %+.2f |\n", a, b);
  }
}

void run(const Options& options) {
  const Device device = Device::open(options.device);
  const Scan scan = shift_to_float(read_scan(options.scan));
  const Rays rays = make_rays(device, scan, options.resolution);
  if (options.splits)
    print_splits(device, scan, rays, options.rounds);
  else
    print_sides(device, scan, rays, options);
}

}  // namespace
}  // namespace rbvh::bench

int main(int argc, char** argv) {
  rbvh::bench::Options options;
  bool sah = false;
  CLI::App app("How large tiles should be: the experiment of the paper's figure 4.");
  app.add_option("SCAN", options.scan, "a scan, as ingest writes it")->required();
  app.add_option("--device", options.device, "OpenCL device");
  app.add_option("--rounds", options.rounds, "repetitions over all sides (the median counts)");
  app.add_option("--resolution", options.resolution, "pixels both ways, a multiple of 8");
  app.add_flag("--splits", options.splits, "table 1 instead: spatial median against surface area heuristic");
  app.add_flag("--sah", sah, "split by the surface area heuristic");
  CLI11_PARSE(app, argc, argv);
  if (sah) options.split = rbvh::SplitRule::kSurfaceArea;
  try {
    rbvh::bench::run(options);
  } catch (const rbvh::Error& error) {
    std::fprintf(stderr, "tile_side_bench: %s\n", error.what());
    return 1;
  }
  return 0;
}
