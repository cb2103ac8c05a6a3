// Measures what each level of a pair is worth: beside its twin, the mesh decimated to the level's error and
// ray cast by Embree. Errors, bytes, rates and build times, in one process, on the same rays. Reports
// figures; passes and fails nothing.
#include <stdlib.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "io/rbvh_file.h"
#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/measure/difference.h"
#include "pipeline/measure/fidelity.h"
#include "pipeline/measure/surface_distance.h"
#include "pipeline/rbvh/level_surface.h"
#include "pipeline/rbvh/rbvh.h"
#include "rbvh/build.h"
#include "rbvh/io.h"
#include "rbvh/render.h"
#include "tests/bench/contenders.h"
#include "tests/bench/lod_report.h"

namespace rbvh::bench {
namespace {

constexpr int kBuilds = 3;                 // timed builds of each kind
constexpr double kBounceOffset = 1e-3;     // of the diagonal
constexpr std::size_t kSamples = 200'000;  // of the distance between surfaces

struct Options {
  std::vector<std::string> scans, levels;
  std::string json_path, pictures, device;
  ViewsConfig views;
  int repetitions = 7, threads = 2;
  bool no_rates = false, distances = false;
};

/// A folder of its own that goes when this does.
struct TemporaryFolder {
  std::filesystem::path path;
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "lod_bench-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr)
      throw Error(ErrorKind::kFailure, name, "a temporary folder cannot be made");
    path = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
};

/// The scan, and what is shared by all levels.
struct Bench {
  Bench(const Device& on, const Options& with, const std::string& path)
      : device(on), options(with), asset(load_asset(path)) {
    if (asset.scan() == nullptr) throw Error(ErrorKind::kInput, path, "is no scan");
    exact = make_tracer(device, asset);
    views = options.views;
    views.up_axis = asset.up_axis();
  }
  const Scan& scan() const { return *asset.scan(); }

  const Device& device;
  const Options& options;
  Asset asset;
  std::unique_ptr<Tracer> exact;
  ViewsConfig views;
};

CastView cast_by(const Tracer& tracer) {
  return [&tracer](const CameraRays& rays) { return intersect(tracer, rays); };
}

std::vector<ViewsFidelity> compare(const Bench& bench, std::span<const CastView> casts) {
  return measure_views(cast_by(*bench.exact), casts, bench.asset.bounds, bench.views);
}

void measure_distances(const Bench& bench, const TriangleSoup& surface, LodFigures& figures) {
  if (!bench.options.distances) return;
  const TriangleSoup scan = surface_of(bench.scan());
  const auto diagonal = static_cast<double>(bench.asset.bounds.diagonal());
  figures.to_scan_rms = sampled_distance(surface, ClosestPoint(scan), kSamples).rms / diagonal;
  figures.from_scan_rms = sampled_distance(scan, ClosestPoint(surface), kSamples).rms / diagonal;
}

double median_seconds(const std::function<void()>& work) {
  Timing timing;
  for (int i = 0; i < kBuilds; ++i) timing.seconds.push_back(seconds_of(work));
  return timing.median();
}

/// The levels, each with its errors and bytes.
std::vector<LodResult> measure_levels_alone(const Bench& bench, const Asset& pair,
                                            const std::vector<std::unique_ptr<Tracer>>& tracers) {
  const std::vector<Level>& levels = pair.rbvh()->levels;
  const TemporaryFolder folder;
  const RbvhBytes bytes = write_rbvh((folder.path / "pair.rbvh").string(), *pair.rbvh(), false);
  std::vector<CastView> casts;
  for (const auto& tracer : tracers) casts.push_back(cast_by(*tracer));
  const std::vector<ViewsFidelity> views = compare(bench, casts);
  std::vector<LodResult> results(levels.size());
  for (std::size_t i = 0; i < levels.size(); ++i) {
    LodResult& result = results[i];
    result.scan = bench.asset.name;
    result.level = levels[i].name;
    result.scan_triangles = bench.scan().triangles.size();
    result.figures.views = views[i];
    result.figures.disk_bytes = bytes.levels[i];
    result.figures.memory_bytes = tracers[i]->memory();
    measure_distances(bench, surface_of(levels[i]), result.figures);
  }
  return results;
}

/// The twin as an asset, with its errors and bytes on disk. `known` as for find_twin().
Asset make_twin(const Bench& bench, double error, std::vector<TwinTrial>& known, TwinFigures& figures) {
  const auto measure_error = [&](const Scan& mesh) {
    const std::unique_ptr<Tracer> tracer = make_tracer(bench.device, make_asset(Scan(mesh)));
    const CastView cast = cast_by(*tracer);
    figures.views = compare(bench, {&cast, 1})[0];
    return figures.views.all.dt.median;
  };
  Twin twin = find_twin(bench.scan(), error, measure_error, known);
  if (figures.views.all.dt.median != twin.error) measure_error(twin.mesh);  // the last trial was not the best
  figures.trials = twin.trials;
  figures.triangles = twin.mesh.triangles.size();
  figures.vertices = twin.mesh.positions.size();
  figures.stored = stored_bytes(twin.mesh);
  figures.disk_bytes = figures.stored.plain;
  Asset asset = make_asset(std::move(twin.mesh));
  measure_distances(bench, surface_of(*asset.scan()), figures);
  return asset;
}

std::vector<EmbreeScene> embree_scenes(const Scan& mesh, int threads) {
  std::vector<EmbreeScene> scenes;
  for (const EmbreeBuild& build : embree_builds()) scenes.emplace_back(mesh, build, threads);
  return scenes;
}

/// A level beside Embree in all its ways on its twin, if there is one.
void measure_rates(const Tracer& level, const std::vector<EmbreeScene>& twin, const TimedRays& rays,
                   int repetitions, LodResult& result) {
  for (const std::string kind : {"primary", "diffuse"}) {
    if (rays.of(kind).empty()) continue;
    const bool is_primary = kind == "primary";
    Report report;
    std::vector<Contender> contenders = embree_contenders(kind, twin, rays);
    contenders.push_back(device_contender(kind, "rbvh", result.level, level, rays));
    run_interleaved(contenders, repetitions, report);
    const int best = compare_with_best(report, kind);
    const RaysResult& own = report.rays.back();
    (is_primary ? result.figures.primary : result.figures.diffuse) = own;
    if (best < 0 || !result.twin) continue;
    (is_primary ? result.twin->primary : result.twin->diffuse) = report.rays[static_cast<std::size_t>(best)];
    (is_primary ? result.primary_of_twin : result.diffuse_of_twin) = own.speedup;
  }
}

void measure_builds(const Bench& bench, const Scan* twin, double embree_seconds, LodResult& result) {
  BuildConfig config;
  config.levels = standard_levels({result.level});
  result.figures.build_s = median_seconds([&] {
    const Asset pair = build_pair(bench.device, bench.scan(), config);
    make_tracer(bench.device, pair);
    bench.device.finish();
  });
  if (twin == nullptr) return;
  result.twin->decimate_s = median_seconds([&] { decimate(bench.scan(), result.twin->triangles); });
  result.twin->build_s = *result.twin->decimate_s + embree_seconds;
}

/// Two pictures of the same size, side by side.
Image beside(const Image& left, const Image& right) {
  Image both = make_image(left.kind, left.width + right.width, left.height, left.channels);
  for (std::uint32_t y = 0; y < left.height; ++y) {
    std::copy_n(left.at(0, y), left.width * left.channels.size(), both.at(0, y));
    std::copy_n(right.at(0, y), right.width * right.channels.size(), both.at(left.width, y));
  }
  return both;
}

/// From the first view: the level and its twin, and of each where it differs from the scan.
void write_pictures(const Bench& bench, const Tracer& level, const Asset* twin, const LodResult& result) {
  if (bench.options.pictures.empty()) return;
  const Bounds3f& bounds = bench.asset.bounds;
  const Bounds3d box = to_double(bounds);
  const std::uint32_t side = bench.views.resolution;
  const Camera camera = views_around(box, bench.views.up_axis, bench.views.views, 1)[0];
  const CameraRays rays = camera_rays(camera, side, side);
  const std::vector<Hit> exact = intersect(*bench.exact, rays);
  RenderConfig config;
  config.width = config.height = side;
  config.up = static_cast<Vec3f>(bench.views.up_axis);
  const std::string stem = result.scan + "-" + result.level + "-";
  const auto write = [&](const std::string& what, const Image& image) {
    write_image((std::filesystem::path(bench.options.pictures) / (stem + what + ".png")).string(), image,
                true);
  };
  const auto difference = [&](const Tracer& tracer) {
    return difference_image(exact, intersect(tracer, rays), rays, bounds.diagonal(), 1);
  };
  std::filesystem::create_directories(bench.options.pictures);
  write("level", render(level, camera, config));
  if (twin == nullptr) return write("difference", difference(level));
  const std::unique_ptr<Tracer> tracer = make_tracer(bench.device, *twin);
  write("twin", render(*tracer, camera, config));
  write("difference", beside(difference(level), difference(*tracer)));
}

std::vector<LodResult> measure(const Device& device, const std::string& path, const Options& options) {
  const Bench bench(device, options, path);
  BuildConfig config;
  config.levels = standard_levels(options.levels);
  const Asset pair = build_pair(device, bench.scan(), config);
  std::vector<std::unique_ptr<Tracer>> tracers;
  for (const std::string& level : level_names(pair)) {
    TracerConfig tracer;
    tracer.level = level;
    tracers.push_back(make_tracer(device, pair, tracer));
  }
  std::vector<LodResult> results = measure_levels_alone(bench, pair, tracers);
  TimedRays rays;
  if (!options.no_rates)
    rays = make_timed_rays(device, *bench.exact, bench.scan(), options.views.resolution, kBounceOffset);
  std::vector<TwinTrial> known;
  for (std::size_t i = 0; i < results.size(); ++i) {
    LodResult& result = results[i];
    Asset twin;
    std::vector<EmbreeScene> scenes;
    if (!bench.asset.is_cloud) {
      const double error = result.figures.views.all.dt.median;
      result.twin.emplace();
      twin = make_twin(bench, error, known, *result.twin);
      scenes = embree_scenes(*twin.scan(), options.threads);
      if (!scenes.empty()) result.twin->memory_bytes = scenes[0].bytes();
      std::fprintf(stderr, "%s %s: median error %.3g; twin of %zu triangles: %.3g, after %d trials\n",
                   result.scan.c_str(), result.level.c_str(), error, result.twin->triangles,
                   result.twin->views.all.dt.median, result.twin->trials);
    }
    write_pictures(bench, *tracers[i], twin.scan() ? &twin : nullptr, result);
    if (options.no_rates) continue;
    measure_rates(*tracers[i], scenes, rays, options.repetitions, result);
    measure_builds(bench, twin.scan(), scenes.empty() ? 0 : scenes[0].build_seconds(), result);
  }
  return results;
}

int run(int argc, char** argv) {
  Options options;
  CLI::App app(
      "Measures each level of a pair beside its twin, the mesh decimated to the level's error and ray cast "
      "by "
      "Embree; prints a table, writes JSON and pictures.\nExample: lod_bench dragon.ply --json lod.json");
  app.add_option("SCAN", options.scans, "scans; a cloud's levels have no twins")->required();
  app.add_option("--json", options.json_path, "one object a level, written here");
  app.add_option(
      "--pictures", options.pictures,
      "folder for three pictures a level: the level, the twin, and their differences from the scan "
      "side by side");
  app.add_option("--levels", options.levels, "only these")->delimiter(',');
  app.add_option("--device", options.device, "OpenCL device: name, index, cpu or gpu");
  app.add_option("--views", options.views.views, "views that errors are measured in")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  app.add_option("--resolution", options.views.resolution,
                 "of views, and primary rays each way; a multiple of 8")
      ->check(CLI::Range(8, 16384))
      ->capture_default_str();
  app.add_option("--repetitions", options.repetitions, "timed tracings of each kind")->capture_default_str();
  app.add_option("--threads", options.threads, "host threads, Embree's and a CPU device's")
      ->capture_default_str();
  app.add_flag("--no-rates", options.no_rates, "errors and bytes only");
  app.add_flag("--distances", options.distances, "also the distances between the surfaces (RMS)");
  CLI11_PARSE(app, argc, argv);
  options.views.resolution = (options.views.resolution + 7) / 8 * 8;
  set_thread_count(options.threads);
  try {
    const Device device = Device::open(options.device);
    std::vector<LodResult> results;
    for (const std::string& path : options.scans) {
      for (LodResult& result : measure(device, path, options)) results.push_back(std::move(result));
      write_report(options.json_path, json(results));  // after each scan: a stopped run has something to show
    }
    std::printf("rbvh %s on %s; %s; %d threads; %d views of %u x %u; %d interleaved repetitions, medians\n",
                RBVH_VERSION, device.info().name.c_str(),
                embree_version().empty() ? "without Embree" : ("Embree " + embree_version()).c_str(),
                options.threads, options.views.views, options.views.resolution, options.views.resolution,
                options.repetitions);
    std::fputs(markdown(results).c_str(), stdout);
  } catch (const Error& error) {
    std::fprintf(stderr, "lod_bench: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace rbvh::bench

int main(int argc, char** argv) { return rbvh::bench::run(argc, argv); }
