// Measures an RBVH against Embree and the exact tracer: builds, bytes, and primary and one-bounce diffuse
// rays, in one process, on the same rays, repetitions interleaved. Reports figures; passes and fails
// nothing.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <functional>

#include "io/output_file.h"
#include "io/scan_io.h"
#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/trace/trace_exact.h"
#include "pipeline/trace/trace_tile.h"
#include "rbvh/camera.h"
#include "tests/bench/bench_rays.h"
#include "tests/bench/bench_report.h"
#include "tests/bench/embree_scene.h"

namespace rbvh::bench {
namespace {

constexpr std::uint32_t kSeed = 1;

struct Options {
  std::vector<std::string> scans;
  std::string csv_path, json_path, device;
  int repetitions = 7, build_repetitions = 3, threads = 2;
  std::uint32_t resolution = 1024;
  double bounce_offset = 1e-3;
  std::vector<int> tables = {1, 2, 3, 4};  ///< of the paper
  bool wants(int table) const { return std::find(tables.begin(), tables.end(), table) != tables.end(); }
};

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Something that traces the rays of one kind, and its result.
struct Contender {
  RaysResult result;
  std::function<void()> trace;
  std::function<std::size_t()> count_hits;
};

std::size_t count_hits(const std::vector<Hit>& hits) {
  return static_cast<std::size_t>(
      std::count_if(hits.begin(), hits.end(), [](const Hit& hit) { return hit.leaf != RBVH_NO_LEAF; }));
}

/// One unmeasured round, then rounds over all contenders, so that a slow phase of the machine slows all.
void run_interleaved(std::vector<Contender>& contenders, int repetitions, Report& report) {
  for (Contender& c : contenders) {
    c.trace();
    c.result.hits = c.count_hits();
  }
  for (int i = 0; i < repetitions; ++i) {
    for (Contender& c : contenders) c.result.timing.seconds.push_back(seconds_of(c.trace));
  }
  for (Contender& c : contenders) report.rays.push_back(std::move(c.result));
}

void add_phase(BuildResult& build, const std::string& name, double seconds) {
  for (BuildResult::Phase& phase : build.phases) {
    if (phase.name == name) {
      phase.timing.seconds.push_back(seconds);
      return;
    }
  }
  build.phases.push_back({name, {{seconds}}});
}

struct Built {
  Rbvh rbvh;
  ExactTracer exact;
  std::vector<EmbreeScene> embree;  ///< as embree_builds()
};

/// Builds once more and adds the times.
Rbvh timed_build(const Device& device, const Scan& scan, const BuildConfig& config, BuildResult& result) {
  BuildTimings timings;
  Rbvh rbvh;
  result.engine = "rbvh";
  result.total.seconds.push_back(seconds_of([&] { rbvh = build_rbvh(device, scan, config, {}, &timings); }));
  add_phase(result, "upload", timings.upload);
  add_phase(result, "partition", timings.partition);
  add_phase(result, "rasterize", timings.rasterize);
  add_phase(result, "pack", timings.pack);
  return rbvh;
}

/// Where the paper's table 4 has the host's and the device's times.
bool is_in_table_4(const LevelConfig& level) {
  return level.name == "Q0" || level.name == "Q2" || level.name == "Q4";
}

Built build_all(const Device& device, const Scan& scan, const Options& options, Report& report) {
  const std::vector<LevelConfig>& levels = standard_levels();
  const std::vector<EmbreeBuild> embree = embree_builds();
  std::vector<BuildResult> alone(levels.size()), on_host(levels.size()), embree_results(embree.size());
  BuildResult together, exact_result;
  together.name = "all levels";
  Built built;
  {  // unmeasured: compiles the kernels
    BuildConfig coarsest;
    coarsest.levels = {levels.back()};
    build_rbvh(device, scan, coarsest);
  }
  const int repetitions = options.wants(4) ? options.build_repetitions : 1;
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    built.rbvh = timed_build(device, scan, {}, together);
    for (std::size_t i = 0; i < levels.size() && options.wants(4); ++i) {
      BuildConfig config;
      config.levels = {levels[i]};
      alone[i].name = levels[i].name;
      timed_build(device, scan, config, alone[i]);
      if (!is_in_table_4(levels[i])) continue;
      config.partition = PartitionWhere::kHost;
      on_host[i].name = levels[i].name + " host";
      timed_build(device, scan, config, on_host[i]);
    }
    ExactTimings timings;
    exact_result.engine = "exact";
    exact_result.name = "SAH";
    exact_result.total.seconds.push_back(
        seconds_of([&] { built.exact = make_exact_tracer(device, scan, {}, &timings); }));
    add_phase(exact_result, "hierarchy", timings.hierarchy);
    add_phase(exact_result, "flatten", timings.flatten);
    add_phase(exact_result, "upload", timings.upload);
    built.embree.clear();
    for (std::size_t i = 0; i < embree.size(); ++i) {
      built.embree.emplace_back(scan, embree[i], options.threads);
      embree_results[i].engine = "embree";
      embree_results[i].name = embree[i].name;
      embree_results[i].total.seconds.push_back(built.embree.back().build_seconds());
    }
  }
  for (const std::vector<BuildResult>* results : {&alone, &on_host, &embree_results})
    for (const BuildResult& result : *results)
      if (!result.name.empty()) report.builds.push_back(result);
  report.builds.push_back(together);
  report.builds.push_back(exact_result);
  return built;
}

void measure_memory(const Built& built, const Scan& scan, Report& report) {
  for (const Level& level : built.rbvh.levels) {
    std::size_t texel_bytes = 0;
    for (const Layer& layer : level.layers) {
      if (layer.name == "height") texel_bytes = layer.texels.size() * sizeof layer.texels[0];
    }
    report.levels.push_back({level.name, level.rho, level.alpha, level.phi_degrees, level.nodes.size(),
                             level.leaves.size(), std::size_t{level.atlas_width} * level.atlas_height,
                             level.texels_used});
    report.memory.push_back({"rbvh", level.name,
                             level.nodes.size() * sizeof(RbvhNode) + level.leaves.size() * sizeof(RbvhLeaf),
                             texel_bytes + level.primitive_leaves.size() * sizeof(RbvhPrimitiveLeaf) +
                                 primitive_count(level) * sizeof(RbvhPrimitive)});
  }
  report.memory.push_back({"exact", "SAH", built.exact.node_bytes(), built.exact.primitive_bytes()});
  const std::size_t vertex = scan.is_cloud() ? 7 * sizeof(float) : sizeof(Vec3f);
  const std::size_t source = scan.positions.size() * vertex + scan.triangles.size() * sizeof(Triangle);
  const std::vector<EmbreeBuild> embree = embree_builds();
  for (std::size_t i = 0; i < built.embree.size(); ++i) {
    // Embree counts the buffers we filled, too.
    const std::size_t bytes = built.embree[i].bytes();
    report.memory.push_back({"embree", embree[i].name, bytes - std::min(bytes, source), source});
  }
}

/// The rays that all are timed with.
struct TimedRays {
  CameraRays words{};
  std::vector<Ray> primary, diffuse;
  Buffer<Ray> diffuse_buffer;
  Buffer<Hit> hits;
};

TimedRays make_rays(const Device& device, const ExactTracer& exact, const Options& options,
                    const Bounds3f& box, bool cloud) {
  TimedRays timed;
  const Bounds3d bounds = {static_cast<Vec3d>(box.lo), static_cast<Vec3d>(box.hi)};
  const Camera camera = place_camera({}, bounds, cloud ? Vec3d{0, 0, 1} : Vec3d{0, 1, 0}, 1.0);
  timed.words = camera_rays(camera, options.resolution, options.resolution);
  timed.primary = primary_rays(timed.words);
  timed.hits = Buffer<Hit>(device, timed.primary.size());
  exact.intersect(Buffer<Ray>(device, timed.primary), timed.hits, timed.primary.size(), RayQuery::kNearest);
  const float offset = static_cast<float>(options.bounce_offset) * box.diagonal();
  timed.diffuse = diffuse_rays(timed.primary, timed.hits.read(), offset, kSeed);
  timed.diffuse_buffer = Buffer<Ray>(device, timed.diffuse);
  return timed;
}

void trace(const Device& device, const auto& tracer, const TimedRays& rays, bool is_primary) {
  if (is_primary)
    tracer.intersect(rays.words, rays.hits);
  else
    tracer.intersect(rays.diffuse_buffer, rays.hits, rays.diffuse.size(), RayQuery::kNearest);
  device.finish();
}

/// The paper's table 1: where nodes are split, and by whom, at the finest level.
void measure_splits(const Device& device, const Scan& scan, const TimedRays& rays, const Options& options,
                    Report& report) {
  std::vector<TileTracer> tracers;
  BuildConfig config;
  config.levels = {standard_levels().front()};
  for (const SplitRule rule : {SplitRule::kSpatialMedian, SplitRule::kSurfaceArea})
    for (const PartitionWhere where : {PartitionWhere::kHost, PartitionWhere::kDevice}) {
      config.split = rule;
      config.partition = where;
      SplitResult& split = report.splits.emplace_back();
      split.is_sah = rule == SplitRule::kSurfaceArea;
      split.on_host = where == PartitionWhere::kHost;
      Rbvh rbvh;
      for (int i = 0; i < options.build_repetitions; ++i)
        rbvh = timed_build(device, scan, config, split.build);
      split.nodes = 2 * rbvh.levels[0].leaves.size() - 1;
      tracers.push_back(make_tile_tracer(device, rbvh.levels[0]));
    }
  for (int i = -1; i < options.repetitions; ++i)
    for (const bool is_primary : {true, false})
      for (std::size_t k = 0; k < tracers.size(); ++k) {
        if (!is_primary && rays.diffuse.empty()) continue;
        const double seconds = seconds_of([&] { trace(device, tracers[k], rays, is_primary); });
        RaysResult& result = is_primary ? report.splits[k].primary : report.splits[k].diffuse;
        result.count = is_primary ? rays.primary.size() : rays.diffuse.size();
        if (i >= 0) result.timing.seconds.push_back(seconds);
      }
}

void measure_rays(const Device& device, const Built& built, const Options& options, const TimedRays& rays,
                  Report& report) {
  const std::vector<Ray>&primary = rays.primary, &diffuse = rays.diffuse;
  std::vector<TileTracer> tracers;
  for (const Level& level : built.rbvh.levels) tracers.push_back(make_tile_tracer(device, level));
  const std::vector<EmbreeBuild> builds = embree_builds();
  for (const std::string kind : {"primary", "diffuse"}) {
    const bool is_primary = kind == "primary";
    const std::size_t count = is_primary ? primary.size() : diffuse.size();
    if (count == 0) continue;
    const auto device_hits = [&] {
      std::vector<Hit> read(count);
      rays.hits.read(read);
      return count_hits(read);
    };
    const auto device_contender = [&](const std::string& engine, const std::string& name,
                                      const auto& tracer) {
      return Contender{{kind, engine, name, count, 0, {}, 0},
                       [&, is_primary] { trace(device, tracer, rays, is_primary); },
                       device_hits};
    };
    std::vector<Contender> contenders;
    for (std::size_t i = 0; i < tracers.size(); ++i) {
      contenders.push_back(device_contender("rbvh", built.rbvh.levels[i].name, tracers[i]));
    }
    contenders.push_back(device_contender("exact", "SAH", built.exact));
    const EmbreeRays embree_rays(is_primary ? primary : diffuse, is_primary);
    std::vector<Hit> embree_hits;
    for (std::size_t i = 0; i < built.embree.size(); ++i) {
      for (const EmbreeVariant& variant : embree_variants()) {
        contenders.push_back(
            {{kind, "embree", builds[i].name + " " + variant.name, count, 0, {}, 0},
             [&, i, variant] { built.embree[i].trace(variant.mode, embree_rays, embree_hits); },
             [&] { return count_hits(embree_hits); }});
      }
    }
    run_interleaved(contenders, options.repetitions, report);
    compare_with_best(report, kind);
  }
}

Report measure(const Device& device, const std::string& path, const Options& options) {
  const Scan scan = shift_to_float(read_scan(path));
  if (scan.is_cloud() && (scan.normals.empty() || scan.radii.empty())) {
    throw Error(ErrorKind::kInput, path, "a cloud without normals and radii: ingest it first");
  }
  Report report;
  report.scan = std::filesystem::path(path).stem().string();
  report.version = RBVH_VERSION;
  report.device = device.info().name;
  report.driver = device.info().driver;
  report.embree = embree_version();
  report.triangles = scan.triangles.size();
  report.points = scan.positions.size();
  report.threads = options.threads;
  report.repetitions = options.repetitions;
  report.resolution = options.resolution;
  const Built built = build_all(device, scan, options, report);
  measure_memory(built, scan, report);
  const TimedRays rays = make_rays(device, built.exact, options, bounds(scan), scan.is_cloud());
  if (options.wants(2)) measure_rays(device, built, options, rays, report);
  if (options.wants(1)) measure_splits(device, scan, rays, options, report);
  return report;
}

void write(const std::string& path, const std::string& text) {
  if (path.empty()) return;
  OutputFile file(path, true);
  file.write(text);
  file.commit();
}

int run(int argc, char** argv) {
  Options options;
  CLI::App app("Measures RBVHs against Embree and exact ray casting; prints tables, writes CSV and JSON");
  app.add_option("SCAN", options.scans, "scans, ingested where they are clouds")->required();
  app.add_option("--csv", options.csv_path, "one row a figure, written here");
  app.add_option("--json", options.json_path, "everything, every repetition, written here");
  app.add_option("--device", options.device, "OpenCL device: name, index, cpu or gpu");
  app.add_option("--repetitions", options.repetitions, "timed tracings of each kind")->capture_default_str();
  app.add_option("--build-repetitions", options.build_repetitions, "timed builds of each kind")
      ->capture_default_str();
  app.add_option("--threads", options.threads, "host threads, Embree's and a CPU device's")
      ->capture_default_str();
  app.add_option("--tables", options.tables,
                 "of the paper's tables 1 to 4 these: only what they need is measured")
      ->delimiter(',')
      ->check(CLI::Range(1, 4));
  app.add_option("--resolution", options.resolution, "primary rays each way, a multiple of 8")
      ->check(CLI::Range(8, 16384))
      ->capture_default_str();
  app.add_option("--bounce-offset", options.bounce_offset,
                 "start of diffuse rays off the surface, in diagonals")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  options.resolution = (options.resolution + 7) / 8 * 8;
  set_thread_count(options.threads);
  try {
    const Device device = Device::open(options.device);
    std::vector<Report> reports;
    for (const std::string& path : options.scans) {
      reports.push_back(measure(device, path, options));
      // After each scan: a long run that is stopped has something to show.
      write(options.csv_path, csv(reports));
      write(options.json_path, json(reports));
    }
    std::fputs(markdown(reports, options.tables).c_str(), stdout);
  } catch (const Error& error) {
    std::fprintf(stderr, "rbvh_bench: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace rbvh::bench

int main(int argc, char** argv) { return rbvh::bench::run(argc, argv); }
