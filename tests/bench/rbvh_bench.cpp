// Measures an RBVH against Embree and the exact tracer: builds, bytes, and primary and one-bounce diffuse
// rays, in one process, on the same rays, repetitions interleaved. Reports figures; passes and fails
// nothing.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "io/scan_io.h"
#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/trace/trace_exact.h"
#include "pipeline/trace/trace_tile.h"
#include "tests/bench/bench_report.h"
#include "tests/bench/contenders.h"
#include "tests/bench/embree_scene.h"

namespace rbvh::bench {
namespace {

struct Options {
  std::vector<std::string> scans;
  std::string csv_path, json_path, device;
  int repetitions = 7, build_repetitions = 3, threads = 2;
  std::uint32_t resolution = 1024;
  double bounce_offset = 1e-3;
  std::vector<int> tables = {1, 2, 3, 4};  ///< of the paper
  bool wants(int table) const { return std::find(tables.begin(), tables.end(), table) != tables.end(); }
};

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
  const std::vector<LevelConfig> levels = by_density(standard_levels());  // as the paper has them
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
    BuildConfig all;
    all.levels = levels;
    built.rbvh = timed_build(device, scan, all, together);
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

/// The paper's table 1: where nodes are split, and by whom, at the finest level.
void measure_splits(const Device& device, const Scan& scan, const TimedRays& rays, const Options& options,
                    Report& report) {
  std::vector<TileTracer> tracers;
  BuildConfig config;
  config.levels = by_density({standard_levels().front()});
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
    for (const std::string kind : {"primary", "diffuse"})
      for (std::size_t k = 0; k < tracers.size(); ++k) {
        if (rays.of(kind).empty()) continue;
        const double seconds = seconds_of([&] { trace(tracers[k], kind, rays); });
        RaysResult& result = kind == "primary" ? report.splits[k].primary : report.splits[k].diffuse;
        result.count = rays.of(kind).size();
        if (i >= 0) result.timing.seconds.push_back(seconds);
      }
}

void measure_rays(const Device& device, const Built& built, const Options& options, const TimedRays& rays,
                  Report& report) {
  std::vector<TileTracer> tracers;
  for (const Level& level : built.rbvh.levels) tracers.push_back(make_tile_tracer(device, level));
  for (const std::string kind : {"primary", "diffuse"}) {
    if (rays.of(kind).empty()) continue;
    std::vector<Contender> contenders;
    for (std::size_t i = 0; i < tracers.size(); ++i)
      contenders.push_back(device_contender(kind, "rbvh", built.rbvh.levels[i].name, tracers[i], rays));
    contenders.push_back(device_contender(kind, "exact", "SAH", built.exact, rays));
    for (Contender& embree : embree_contenders(kind, built.embree, rays))
      contenders.push_back(std::move(embree));
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
  const TimedRays rays =
      make_timed_rays(device, built.exact, scan, options.resolution, options.bounce_offset);
  if (options.wants(2)) measure_rays(device, built, options, rays, report);
  if (options.wants(1)) measure_splits(device, scan, rays, options, report);
  return report;
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
      write_report(options.csv_path, csv(reports));
      write_report(options.json_path, json(reports));
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
