// Measures the exact hierarchies: every traversal on every builder's tree, beside Embree in the same process,
// on the same rays. Each alternates with Embree's single rays, and is compared by the median of the ratios,
// so that a slow phase of the machine slows both. Reports figures; passes and fails nothing.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "io/output_file.h"
#include "io/scan_io.h"
#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/bvh/lbvh.h"
#include "pipeline/bvh/primitive_bounds.h"
#include "pipeline/bvh/sah_binned_bvh.h"
#include "pipeline/device/device.h"
#include "pipeline/trace/trace_exact.h"
#include "rbvh/camera.h"
#include "tests/bench/bench_rays.h"
#include "tests/bench/embree_scene.h"

namespace rbvh::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint32_t kSeed = 1;
constexpr double kBounceOffset = 1e-3;  // of the diagonal

struct Options {
  std::vector<std::string> scans, tracers, builders;
  std::string csv_path, json_path, device;
  int repetitions = 5, build_repetitions = 1, threads = 2, subdivisions = 0;
  std::uint32_t resolution = 1024;
};

/// One kind of rays on the device, and as Embree wants them.
struct RaySet {
  std::string name;
  RayQuery query;
  std::size_t count;
  Buffer<Ray> rays;
  std::unique_ptr<EmbreeRays> embree;
};

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Each triangle in four, without moving the surface.
Scan subdivided(const Scan& scan) {
  Scan fine;
  fine.positions = scan.positions;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
  const auto middle = [&](std::uint32_t a, std::uint32_t b) {
    const auto [at, is_new] =
        middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(fine.positions.size()));
    if (is_new) fine.positions.push_back((scan.positions[a] + scan.positions[b]) * 0.5f);
    return at->second;
  };
  for (const auto& [a, b, c] : scan.triangles) {
    const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    for (const Triangle& t : {Triangle{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}}) {
      fine.triangles.push_back(t);
    }
  }
  return fine;
}

CameraRays make_camera(const Scan& scan, std::uint32_t resolution) {
  const Bounds3f box = bounds(scan);
  const Camera camera =
      place_camera({}, {static_cast<Vec3d>(box.lo), static_cast<Vec3d>(box.hi)}, {0, 1, 0}, 1.0);
  return camera_rays(camera, resolution, resolution);
}

std::vector<RaySet> make_rays(const Device& device, const Scan& scan, const Options& options) {
  const Bounds3f box = bounds(scan);
  const std::vector<Ray> primary = primary_rays(make_camera(scan, options.resolution));
  Buffer<Hit> hit_buffer(device, primary.size());
  make_exact_tracer(device, scan)
      .intersect(Buffer<Ray>(device, primary), hit_buffer, primary.size(), RayQuery::kNearest);
  const std::vector<Hit> hits = hit_buffer.read();
  const float offset = static_cast<float>(kBounceOffset) * box.diagonal();
  const std::vector<Ray> diffuse = diffuse_rays(primary, hits, offset, kSeed);
  // Shadows of a lamp above the camera's left shoulder, two diagonals away.
  const Vec3f lamp = box.center() + Vec3f{-0.8f, 1.6f, 0.9f} * box.diagonal();
  std::vector<Ray> shadow = diffuse;
  for (Ray& ray : shadow) {
    const Vec3f d = lamp - Vec3f{ray.origin[0], ray.origin[1], ray.origin[2]};
    for (int axis = 0; axis < 3; ++axis) ray.direction[axis] = d[axis];
    ray.tmax = 1;
  }
  std::vector<RaySet> sets;
  sets.push_back({"primary",
                  RayQuery::kNearest,
                  primary.size(),
                  {device, primary},
                  std::make_unique<EmbreeRays>(primary, true)});
  if (diffuse.empty()) return sets;
  sets.push_back({"shadow",
                  RayQuery::kAny,
                  shadow.size(),
                  {device, shadow},
                  std::make_unique<EmbreeRays>(shadow, false, RayQuery::kAny)});
  sets.push_back({"diffuse",
                  RayQuery::kNearest,
                  diffuse.size(),
                  {device, diffuse},
                  std::make_unique<EmbreeRays>(diffuse, false)});
  return sets;
}

/// Embree's better build for a mode, by its primary rays.
struct Embree {
  std::unique_ptr<EmbreeScene> scene;
  std::string name;
};

std::vector<Embree> make_embree(const Scan& scan, int threads) {
  std::vector<Embree> scenes;
  for (const EmbreeBuild& build : embree_builds()) {
    if (!build.high_quality) {
      scenes.push_back({std::make_unique<EmbreeScene>(scan, build, threads), build.name});
    }
  }
  return scenes;
}

Json measure_embree(const std::vector<Embree>& scenes, EmbreeMode mode, const std::string& mode_name,
                    const std::vector<RaySet>& sets, int repetitions) {
  Json row = {{"tracer", "embree " + mode_name}, {"builder", "MEDIUM"}};
  double build = scenes[0].scene->build_seconds();
  for (const Embree& e : scenes) build = std::min(build, e.scene->build_seconds());
  row["build_seconds"] = build;
  row["bytes"] = scenes[0].scene->bytes();
  std::vector<Hit> hits;
  for (const RaySet& set : sets) {
    double best = 0;
    for (const Embree& e : scenes) {
      std::vector<double> seconds;
      e.scene->trace(mode, *set.embree, hits);
      for (int i = 0; i < repetitions; ++i) {
        seconds.push_back(seconds_of([&] { e.scene->trace(mode, *set.embree, hits); }));
      }
      best = std::max(best, static_cast<double>(set.count) / median(seconds) * 1e-6);
    }
    row[set.name] = {{"mrays", best}};
  }
  return row;
}

/// Alternates with Embree's better build.
Json measure_rays(const std::function<void()>& trace, const RaySet& set, const std::vector<Embree>& embree,
                  EmbreeMode mode, int repetitions) {
  trace();  // compiles
  std::vector<double> seconds, ratios;
  std::vector<Hit> embree_hits;
  for (int i = 0; i < repetitions; ++i) {
    seconds.push_back(seconds_of(trace));
    if (embree.empty()) continue;
    double fastest = std::numeric_limits<double>::infinity();
    for (const Embree& e : embree) {
      fastest = std::min(fastest, seconds_of([&] { e.scene->trace(mode, *set.embree, embree_hits); }));
    }
    ratios.push_back(fastest / seconds.back());
  }
  Json result = {{"mrays", static_cast<double>(set.count) / median(seconds) * 1e-6}};
  if (!ratios.empty()) {
    result[mode == EmbreeMode::kSingle ? "of_embree_single" : "of_embree_packet16"] = median(ratios);
  }
  return result;
}

Json measure_method(const Device& device, const Scan& scan, const ExactTraversalInfo& traversal,
                    const ExactBuilderInfo& builder, const std::vector<RaySet>& sets,
                    const std::vector<Embree>& embree, const Options& options) {
  ExactTimings timings;
  ExactTracer tracer;
  std::vector<double> builds, hierarchies;
  for (int i = 0; i < options.build_repetitions; ++i) {
    tracer = {};
    tracer = make_exact_tracer(device, scan, {traversal.traversal, builder.builder}, &timings);
    device.finish();
    hierarchies.push_back(timings.hierarchy);
    builds.push_back(timings.hierarchy + timings.flatten + timings.upload);
  }
  Json row = {{"tracer", traversal.name}, {"builder", builder.name}};
  row["build_seconds"] = median(builds);
  row["hierarchy_seconds"] = median(hierarchies);
  row["sah_cost"] = timings.sah_cost;
  row["bytes"] = tracer.memory();
  {  // the same primary rays, made on the device: wide16 takes them in packets
    const CameraRays camera = make_camera(scan, options.resolution);
    const Buffer<Hit> hits(device, sets[0].count);
    const auto trace = [&] {
      tracer.intersect(camera, hits);
      device.finish();
    };
    row["camera"] = measure_rays(trace, sets[0], embree, EmbreeMode::kPacket16, options.repetitions);
  }
  for (const RaySet& set : sets) {
    const Buffer<Hit> hits(device, set.count);
    const auto trace = [&] {
      tracer.intersect(set.rays, hits, set.count, set.query);
      device.finish();
    };
    row[set.name] = measure_rays(trace, set, embree, EmbreeMode::kSingle, options.repetitions);
    const ExactVisits visits = mean_visits(tracer, set.rays, set.count, set.query);
    row[set.name]["nodes_per_ray"] = visits.nodes;
    row[set.name]["primitives_per_ray"] = visits.primitives;
  }
  return row;
}

/// LBVH by phase at growing sizes, beside a serial host builder: the sort's share, and from where it pays.
Json measure_lbvh(const Device& device, const Scan& scan, int threads) {
  const std::vector<Bounds3f> boxes = primitive_bounds(scan);
  const BvhConfig config{8, 8};
  build_lbvh(device, boxes, config);  // compiles
  Json rows = Json::array();
  for (std::size_t count = 1024;; count = std::min(count * 4, boxes.size())) {
    count = std::min(count, boxes.size());
    const std::span<const Bounds3f> part(boxes.data(), count);
    std::vector<double> device_seconds, serial_seconds, shares;
    LbvhTimings t;
    for (int i = 0; i < 3; ++i) {
      device_seconds.push_back(seconds_of([&] { build_lbvh(device, part, config, MortonBits::k63, &t); }));
      shares.push_back(t.sort / device_seconds.back());
      set_thread_count(1);
      serial_seconds.push_back(seconds_of([&] { build_sah_binned_bvh(part, config); }));
      set_thread_count(threads);
    }
    rows.push_back({{"triangles", count},
                    {"lbvh_seconds", median(device_seconds)},
                    {"sort_share", median(shares)},
                    {"last_phases", {{"order", t.order}, {"nodes", t.nodes}, {"link", t.link}}},
                    {"serial_sah_binned_seconds", median(serial_seconds)}});
    if (count == boxes.size()) break;
  }
  return rows;
}

double number(const Json& row, const char* a, const char* b = nullptr) {
  if (!row.contains(a)) return 0;
  if (b == nullptr) return row[a].get<double>();
  return row[a].contains(b) ? row[a][b].get<double>() : 0;
}

void print(const Json& report) {
  std::printf("\n%s, %zu triangles; %s; Embree %s\n\n", report["scan"].get<std::string>().c_str(),
              report["triangles"].get<std::size_t>(), report["device"].get<std::string>().c_str(),
              report["embree"].get<std::string>().c_str());
  std::printf(
      "| Tracer | Builder | Build [s] | SAH cost | MB | Camera | of packet16 | Primary | of single | Shadow "
      "| of single | Diffuse | of single | Nodes, primitives: primary | diffuse |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
  for (const Json& r : report["methods"]) {
    std::printf(
        "| %s | %s | %.3f | %.1f | %.1f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | "
        "%.1f, %.1f | %.1f, %.1f |\n",
        r["tracer"].get<std::string>().c_str(), r["builder"].get<std::string>().c_str(),
        number(r, "build_seconds"), number(r, "sah_cost"), number(r, "bytes") * 1e-6,
        number(r, "camera", "mrays"), number(r, "camera", "of_embree_packet16"),
        number(r, "primary", "mrays"), number(r, "primary", "of_embree_single"), number(r, "shadow", "mrays"),
        number(r, "shadow", "of_embree_single"), number(r, "diffuse", "mrays"),
        number(r, "diffuse", "of_embree_single"), number(r, "primary", "nodes_per_ray"),
        number(r, "primary", "primitives_per_ray"), number(r, "diffuse", "nodes_per_ray"),
        number(r, "diffuse", "primitives_per_ray"));
  }
  std::printf(
      "\n| Triangles | LBVH [ms] | sort's share | serial SAH, binned [ms] |\n| --- | --- | --- | --- |\n");
  for (const Json& r : report["lbvh"]) {
    std::printf("| %zu | %.2f | %.0f%% | %.2f |\n", r["triangles"].get<std::size_t>(),
                number(r, "lbvh_seconds") * 1e3, number(r, "sort_share") * 100,
                number(r, "serial_sah_binned_seconds") * 1e3);
  }
  std::fflush(stdout);
}

std::string csv(const std::vector<Json>& reports) {
  std::string text = "scan,triangles,tracer,builder,figure,value\n";
  for (const Json& report : reports) {
    for (const Json& row : report["methods"]) {
      const Json flat = row.flatten();
      for (const auto& [key, value] : flat.items()) {
        if (!value.is_number()) continue;
        std::string figure = key.substr(1);
        std::replace(figure.begin(), figure.end(), '/', '_');
        text += report["scan"].get<std::string>() + "," + report["triangles"].dump() + "," +
                row["tracer"].get<std::string>() + "," + row["builder"].get<std::string>() + "," + figure +
                "," + value.dump() + "\n";
      }
    }
  }
  return text;
}

void write(const std::string& path, const std::string& text) {
  if (path.empty()) return;
  OutputFile file(path, true);
  file.write(text);
  file.commit();
}

bool wanted(const std::vector<std::string>& names, const char* name) {
  return names.empty() || std::find(names.begin(), names.end(), name) != names.end();
}

Json measure(const Device& device, const std::string& path, const Options& options) {
  Scan scan = shift_to_float(read_scan(path));
  if (scan.is_cloud()) throw Error(ErrorKind::kInput, path, "a cloud: only triangles are measured here");
  for (int i = 0; i < options.subdivisions; ++i) scan = subdivided(scan);
  Json report = {{"scan", std::filesystem::path(path).stem().string()},
                 {"triangles", scan.triangles.size()},
                 {"version", RBVH_VERSION},
                 {"device", device.info().name},
                 {"embree", embree_version()},
                 {"threads", options.threads},
                 {"repetitions", options.repetitions}};
  const std::vector<RaySet> sets = make_rays(device, scan, options);
  const std::vector<Embree> embree = make_embree(scan, options.threads);
  Json rows = Json::array();
  if (!embree.empty()) {
    rows.push_back(measure_embree(embree, EmbreeMode::kSingle, "single", sets, options.repetitions));
    rows.push_back(measure_embree(embree, EmbreeMode::kPacket16, "packet16", sets, options.repetitions));
  }
  for (const ExactTraversalInfo& t : kExactTraversals) {
    for (const ExactBuilderInfo& b : kExactBuilders) {
      if (b.tree != t.tree || !wanted(options.tracers, t.name) || !wanted(options.builders, b.name)) continue;
      rows.push_back(measure_method(device, scan, t, b, sets, embree, options));
    }
  }
  report["methods"] = rows;
  report["lbvh"] = measure_lbvh(device, scan, options.threads);
  return report;
}

int run(int argc, char** argv) {
  Options options;
  CLI::App app("Measures exact builders and traversals beside Embree; prints tables, writes CSV and JSON");
  app.add_option("SCAN", options.scans, "meshes")->required();
  app.add_option("--tracer", options.tracers, "only these")->delimiter(',');
  app.add_option("--builder", options.builders, "only these")->delimiter(',');
  app.add_option("--csv", options.csv_path, "one row a figure, written here");
  app.add_option("--json", options.json_path, "everything, written here");
  app.add_option("--device", options.device, "OpenCL device: name, index, cpu or gpu");
  app.add_option("--repetitions", options.repetitions, "timed tracings of each kind")->capture_default_str();
  app.add_option("--build-repetitions", options.build_repetitions, "timed builds of each")
      ->capture_default_str();
  app.add_option("--threads", options.threads, "host threads, Embree's and a CPU device's")
      ->capture_default_str();
  app.add_option("--subdivide", options.subdivisions, "times that each triangle is cut in four")
      ->capture_default_str();
  app.add_option("--resolution", options.resolution, "primary rays each way, a multiple of 8")
      ->check(CLI::Range(8, 16384))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  options.resolution = (options.resolution + 7) / 8 * 8;
  set_thread_count(options.threads);
  try {
    const Device device = Device::open(options.device);
    std::vector<Json> reports;
    for (const std::string& path : options.scans) {
      reports.push_back(measure(device, path, options));
      print(reports.back());
      write(options.csv_path, csv(reports));
      write(options.json_path, Json(reports).dump(2) + "\n");
    }
  } catch (const Error& error) {
    std::fprintf(stderr, "exact_bench: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace rbvh::bench

int main(int argc, char** argv) { return rbvh::bench::run(argc, argv); }
