// Measures ray tracing proxies untessellated beside their tessellated references traced exactly: memory
// (table 1.1 of Harada, "Rendering Vector Displacement Mapped Surfaces in a GPU Ray Tracer", GPU Pro 6), time
// by phase for primary, shadow and bounced rays (figures 1.7, 1.9, 1.10), and time by rays a patch. The
// scenes are made here, after the source's four: one pumpkin, one bark, seven barks, and a party of both.
// Reports figures; passes and fails nothing.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <functional>
#include <numbers>
#include <optional>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/device/device.h"
#include "pipeline/proxy/tessellate.h"
#include "pipeline/trace/trace_exact.h"
#include "pipeline/trace/trace_patch.h"
#include "rbvh/camera.h"
#include "tests/bench/bench_rays.h"
#include "tests/proxy_shapes.h"

namespace rbvh::bench {
namespace {

struct Options {
  std::vector<std::string> scenes;
  std::uint32_t resolution = 1024;
  int repetitions = 3, bounces = 5;
  std::size_t cache_mb = 512, reference_mb = 3000;
  bool sweep = true;
  std::vector<std::uint32_t> sweep_sizes = {64, 104, 144, 200, 288, 408, 576, 816, 1152, 1632};
  std::uint32_t few_rays = ProxyConfig{}.few_rays;
};

struct BenchScene {
  std::string name;
  Proxy proxy;
  double triangles = 0;  ///< of the reference at the tiles' own levels
};

constexpr std::uint32_t kLevel = 7;  // 128 x 128 micro-quads a patch

Vec3f pumpkin(Vec3f p) {
  const Vec3f n = normalized(p);
  const float ribs = std::abs(std::sin(5 * std::atan2(n.x, n.z)));
  const float poles = std::max(0.0f, 1 - n.x * n.x - n.z * n.z);
  return n * (0.25f * (ribs - 1) * (1 - poles) - 0.35f * poles * poles) + mushrooms(p, 0.02f) +
         ripples(p, 60, 4) * 0.002f;
}

// Furrows that lean over, around the y axis.
Vec3f bark(Vec3f p) {
  const float angle = std::atan2(p.z, p.x), wander = 0.6f * std::sin(2.1f * p.y + std::cos(angle));
  const float furrow = std::sin(14 * angle + 5 * wander + 3 * std::sin(3.7f * p.y));
  const float plates = std::tanh(3 * furrow) * (0.7f + 0.3f * std::sin(9 * p.y + 4 * furrow));
  const Vec3f out = {std::cos(angle), 0, std::sin(angle)}, around = {-std::sin(angle), 0, std::cos(angle)};
  return out * (0.07f * plates) +
         around * (0.05f * std::cos(14 * angle + 5 * wander) * std::max(plates, 0.0f)) +
         ripples(p, 25, 5) * 0.008f;
}

Proxy make_pumpkin() { return displaced(quad_sphere(5), std::span(&kLevel, 1), pumpkin); }

Proxy make_bark() {
  const auto trunk = [](float s, float t) {
    const float angle = -2 * std::numbers::pi_v<float> * s;
    return Vec3f{0.6f * std::cos(angle), 6 * t - 3, 0.6f * std::sin(angle)};
  };
  return displaced(quad_sheet(20, 32, trunk, true), std::span(&kLevel, 1), bark);
}

/// Copies of quads only: they share the map, and nothing else.
void add_copy(Proxy& all, const Proxy& one, std::uint32_t map_row, Vec3f at) {
  const auto first = static_cast<std::uint32_t>(all.positions.size());
  for (const Vec3f& p : one.positions) all.positions.push_back(p + at);
  for (const Quad& q : one.quads)
    all.quads.push_back({q[0] + first, q[1] + first, q[2] + first, q[3] + first});
  for (PatchTile tile : one.tiles) {
    tile.y += map_row;
    all.tiles.push_back(tile);
  }
}

std::uint32_t add_map(Proxy& all, const Proxy& one) {
  const std::uint32_t row = all.map_height, width = std::max(all.map_width, one.map_width);
  RBVH_CHECK(all.map_height == 0 || all.map_width == width);
  all.map_width = width;
  all.map_height += one.map_height;
  for (std::uint32_t y = 0; y < one.map_height; ++y) {
    const auto from = one.map.begin() + std::ptrdiff_t{y} * one.map_width;
    all.map.insert(all.map.end(), from, from + one.map_width);
    all.map.resize(std::size_t{row + y + 1} * width);
  }
  return row;
}

BenchScene make_scene(const std::string& name) {
  BenchScene scene{name, {}, 0};
  if (name == "pumpkin") {
    scene.proxy = make_pumpkin();
  } else if (name == "bark") {
    scene.proxy = make_bark();
  } else if (name == "barks") {
    const Proxy one = make_bark();
    const std::uint32_t map = add_map(scene.proxy, one);
    for (int i = 0; i < 7; ++i)
      add_copy(scene.proxy, one, map,
               {2.2f * static_cast<float>(i - 3), 0, 1.5f * static_cast<float>(i * i % 5)});
  } else if (name == "party") {
    const Proxy trunk = make_bark(), fruit = make_pumpkin();
    const std::uint32_t trunk_map = add_map(scene.proxy, trunk), fruit_map = add_map(scene.proxy, fruit);
    for (int i = 0; i < 24; ++i)
      add_copy(scene.proxy, trunk, trunk_map,
               {3.1f * static_cast<float>(i % 6) - 8, 0, -3.3f * static_cast<float>(i / 6) - 3});
    for (int i = 0; i < 30; ++i)
      add_copy(scene.proxy, fruit, fruit_map,
               {2.7f * static_cast<float>(i % 6) - 7, -2.3f, 2.6f * static_cast<float>(i / 6) - 1});
  } else {
    throw Error(ErrorKind::kUsage, {}, "'" + name + "' is none of pumpkin, bark, barks, party");
  }
  for (const PatchTile& tile : scene.proxy.tiles) scene.triangles += 2.0 * (tile.side - 1) * (tile.side - 1);
  return scene;
}

bool counts_processor_time = false;  ///< of all threads, in place of elapsed time

double now() {
  if (counts_processor_time) return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double seconds_of(const Device& device, const std::function<void()>& work) {
  device.finish();
  const double start = now();
  work();
  device.finish();
  return now() - start;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// --- rays
// -----------------------------------------------------------------------------------------------------------

/// One kind of rays: milliseconds with nothing built, once more, with what the casts before it built,
/// and of the reference; all on the same rays, interleaved, as what slows one down for a while slows all.
struct Row {
  std::string rays;
  RayQuery query = RayQuery::kNearest;
  std::vector<Ray> set;
  std::size_t hits = 0;
  double cold = 0, warm = 0, kept = 0, reference = 0, cold_ratio = 0, warm_ratio = 0;
  ProxyStats phases;                        ///< of a cold cast
  ProxyStats kept_phases;                   ///< of one after the casts before
  double visits = 0, reference_visits = 0;  ///< nodes, blocks, micro-quads a ray
  double ns(double milliseconds) const {
    return milliseconds * 1e6 / static_cast<double>(std::max<std::size_t>(1, set.size()));
  }
};

/// Casts the row's rays, again and again, and returns the hits.
std::vector<Hit> measure_row(const PatchTracer& tracer, const std::optional<ExactTracer>& reference,
                             int repetitions, Row& row) {
  const Device& device = tracer.device;
  const Buffer<Ray> rays(device, row.set);
  const Buffer<Hit> hits(device, row.set.size());
  const auto time = [&](const auto& with) {
    return 1e3 * seconds_of(device, [&] { with.intersect(rays, hits, row.set.size(), row.query); });
  };
  std::vector<double> cold, warm, exact, cold_ratios, warm_ratios;
  for (int i = 0; i < repetitions; ++i) {
    clear_cache(tracer);
    cold.push_back(time(tracer));
    warm.push_back(time(tracer));
    if (!reference) continue;
    exact.push_back(time(*reference));
    cold_ratios.push_back(cold.back() / exact.back());
    warm_ratios.push_back(warm.back() / exact.back());
  }
  clear_cache(tracer);
  stats(tracer) = {};
  stats(tracer).timed = true;  // waits between phases, so apart
  time(tracer);
  row.phases = stats(tracer);
  stats(tracer).timed = false;
  row.cold = median(cold);
  row.warm = median(warm);
  if (reference) {
    row.reference = median(exact);
    row.cold_ratio = median(cold_ratios);
    row.warm_ratio = median(warm_ratios);
  }
  std::vector<Hit> found = hits.read();
  for (const Hit& hit : found) row.hits += hit.leaf != RBVH_NO_LEAF;
  return found;
}

/// Primary rays, shadow rays to the sky, and bounces.
std::vector<Row> measure_rows(const PatchTracer& tracer, const std::optional<ExactTracer>& reference,
                              const CameraRays& camera, float offset, const Options& options) {
  std::vector<Row> rows;
  const auto add = [&](const std::string& name, RayQuery query, std::vector<Ray> rays) {
    rows.emplace_back();
    rows.back().rays = name;
    rows.back().query = query;
    rows.back().set = std::move(rays);
  };
  add("primary", RayQuery::kNearest, primary_rays(camera));
  std::vector<Hit> hits = measure_row(tracer, reference, options.repetitions, rows.back());
  add("shadow", RayQuery::kAny, diffuse_rays(rows[0].set, hits, offset, 77));
  measure_row(tracer, reference, options.repetitions, rows.back());
  std::vector<Ray> before = rows[0].set;
  for (int bounce = 1; bounce <= options.bounces; ++bounce) {
    std::vector<Ray> rays = diffuse_rays(before, hits, offset, static_cast<std::uint32_t>(bounce));
    if (rays.empty()) break;
    before = rays;
    add("bounce " + std::to_string(bounce), RayQuery::kNearest, std::move(rays));
    hits = measure_row(tracer, reference, options.repetitions, rows.back());
  }
  std::vector<std::vector<double>> kept(rows.size());
  for (int i = 0; i < options.repetitions; ++i) {
    clear_cache(tracer);
    for (std::size_t r = 0; r < rows.size(); ++r) {
      const Buffer<Ray> rays(tracer.device, rows[r].set);
      const Buffer<Hit> found(tracer.device, rows[r].set.size());
      kept[r].push_back(1e3 * seconds_of(tracer.device, [&] {
                          tracer.intersect(rays, found, rows[r].set.size(), rows[r].query);
                        }));
    }
  }
  for (std::size_t r = 0; r < rows.size(); ++r) rows[r].kept = median(kept[r]);
  clear_cache(tracer);
  for (Row& row : rows) {
    const Buffer<Ray> rays(tracer.device, row.set);
    const Buffer<Hit> found(tracer.device, row.set.size());
    stats(tracer) = {};
    stats(tracer).timed = true;
    tracer.intersect(rays, found, row.set.size(), row.query);
    row.kept_phases = stats(tracer);
    const Buffer<std::uint32_t> steps(tracer.device, row.set.size());
    tracer.intersect(rays, found, row.set.size(), row.query, &steps);
    for (const std::uint32_t visited : steps.read()) row.visits += visited;
    row.visits /= static_cast<double>(row.set.size());
    if (reference) {
      const ExactVisits visits = mean_visits(*reference, rays, row.set.size(), row.query);
      row.reference_visits = visits.nodes + visits.primitives;
    }
  }
  stats(tracer) = {};
  return rows;
}

void print_rows(const std::vector<Row>& rows) {
  std::printf(
      "| Rays | count | top, middle [ms] | sort | build | patches | all, nothing built | after the casts "
      "before | the same again | ns a ray | reference [ms] | nothing built / reference | again / reference "
      "|\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
  for (const Row& r : rows)
    std::printf("| %s | %zu | %.1f | %.1f | %.1f | %.1f | %.1f | %.1f | %.1f | %.0f | %.1f | %.2f | %.2f |\n",
                r.rays.c_str(), r.set.size(), r.phases.top * 1e3, r.phases.sort * 1e3, r.phases.build * 1e3,
                r.phases.cast * 1e3, r.cold, r.kept, r.warm, r.ns(r.warm), r.reference, r.cold_ratio,
                r.warm_ratio);
  std::printf(
      "\n| After the casts before | top, middle [ms] | sort | build | patches | rounds | work items | built "
      "| "
      "evicted | visits a ray | of the reference |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | "
      "--- | "
      "--- |\n");
  for (const Row& r : rows) {
    const ProxyStats& s = r.kept_phases;
    std::printf("| %s | %.1f | %.1f | %.1f | %.1f | %llu | %llu | %llu | %llu | %.1f | %.1f |\n",
                r.rays.c_str(), s.top * 1e3, s.sort * 1e3, s.build * 1e3, s.cast * 1e3,
                static_cast<unsigned long long>(s.rounds), static_cast<unsigned long long>(s.items),
                static_cast<unsigned long long>(s.built), static_cast<unsigned long long>(s.evicted),
                r.visits, r.reference_visits);
  }
  std::fflush(stdout);
}

CameraRays make_camera(const Bounds3f& box, std::uint32_t resolution) {
  Bounds3d bounds = to_double(box);
  return camera_rays(place_camera({}, bounds, {0, 1, 0}, 1), resolution, resolution);
}

Bounds3f box_of(const Proxy& proxy) {
  Bounds3f box;
  for (const Vec3f& p : proxy.positions) box.add(p);
  return box;
}

void measure(const Device& device, const Options& options, const std::string& name) {
  const BenchScene scene = make_scene(name);
  ProxyConfig config;
  config.cache_bytes = options.cache_mb << 20;
  config.few_rays = options.few_rays;
  PatchTracer tracer;
  const double prepare = seconds_of(device, [&] { tracer = make_patch_tracer(device, scene.proxy, config); });
  const Bounds3f box = box_of(scene.proxy);
  const CameraRays camera = make_camera(box, options.resolution);
  const float offset = 1e-4f * box.diagonal();
  set_detail(tracer, camera);
  const ProxyBytes memory = bytes(tracer);

  std::optional<ExactTracer> reference;
  double reference_bytes = 0, reference_seconds = 0;
  const double estimate = scene.triangles * 80;
  if (estimate < static_cast<double>(options.reference_mb) * 1e6) {
    reference_seconds = seconds_of(device, [&] {
      const Scan mesh = tessellate(scene.proxy, kLevel);
      reference_bytes = static_cast<double>(mesh.positions.size() * sizeof(Vec3f) +
                                            mesh.triangles.size() * sizeof(Triangle));
      reference = make_exact_tracer(device, mesh);
    });
    reference_bytes += static_cast<double>(reference->memory());
  }
  std::printf(
      "\n## %s: %zu patches, %.1f M triangles tessellated; prepared in %.2f s (reference: %.1f s)\n\n",
      name.c_str(), scene.proxy.quads.size(), scene.triangles * 1e-6, prepare, reference_seconds);
  std::printf(
      "tessellated %.1f MB (%.1f bytes a triangle), direct %.3f MB without maps, %.1f MB maps; cache limit "
      "%.0f MB\n\n",
      reference_bytes * 1e-6, reference_bytes / scene.triangles, static_cast<double>(memory.base) * 1e-6,
      static_cast<double>(memory.maps) * 1e-6, static_cast<double>(memory.cache) * 1e-6);

  Options quick = options;
  quick.repetitions = 1;
  measure_rows(tracer, reference, make_camera(box, 64), offset, quick);  // compiles
  const std::vector<Row> rows = measure_rows(tracer, reference, camera, offset, options);
  print_rows(rows);
  if (rows.size() > 6)
    std::printf(
        "\na ray at bounce 5 costs %.2f of one at bounce 1 with what the casts before it built, the "
        "reference's "
        "%.2f; "
        "in the cache: %.1f MB\n",
        rows[6].ns(rows[6].kept) / rows[2].ns(rows[2].kept),
        reference ? rows[6].ns(rows[6].reference) / rows[2].ns(rows[2].reference) : 0.0,
        static_cast<double>(bytes(tracer).cached) * 1e-6);
}

// Many patches, so that few rays a patch are still many rays.
void measure_rays_a_patch(const Device& device, const Options& options) {
  constexpr std::uint32_t kGlobeLevel = 5;
  const Proxy proxy = displaced(quad_sphere(32), std::span(&kGlobeLevel, 1),
                                [](Vec3f p) { return mushrooms(p, 0.05f) + ripples(p, 90, 3) * 0.002f; });
  ProxyConfig config;
  config.cache_bytes = options.cache_mb << 20;
  config.few_rays = options.few_rays;
  const PatchTracer tracer = make_patch_tracer(device, proxy, config);
  const Scan mesh = tessellate(proxy, kGlobeLevel);
  const ExactTracer reference = make_exact_tracer(device, mesh);
  std::printf(
      "\n## By rays a patch: %zu patches, %.1f M triangles tessellated\n\n"
      "| image | patches reached | rays a patch | top, sort, build, patches [ms] | direct, cold [ms] | "
      "direct, cached [ms] | reference [ms] | cold / reference | "
      "cached / reference | reference's camera packets [ms] | cached camera / those |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
      proxy.quads.size(), static_cast<double>(mesh.triangles.size()) * 1e-6);
  for (const std::uint32_t resolution : options.sweep_sizes) {
    const CameraRays camera = make_camera(box_of(proxy), resolution);
    set_detail(tracer, camera);
    const std::vector<Ray> rays = primary_rays(camera);
    const Buffer<Ray> ray_buffer(device, rays);
    const Buffer<Hit> hits(device, rays.size());
    const auto time = [&](const auto& with) {
      return 1e3 *
             seconds_of(device, [&] { with.intersect(ray_buffer, hits, rays.size(), RayQuery::kNearest); });
    };
    const Buffer<Hit> seen(device, rays.size());
    const auto time_camera = [&](const auto& with) {
      return 1e3 * seconds_of(device, [&] { with.intersect(camera, seen); });
    };
    std::vector<double> cold, cached, exact, cold_ratios, cached_ratios, packets, packet_ratios;
    time(reference);
    time_camera(reference);
    for (int i = 0; i < 2 * options.repetitions + 1; ++i) {  // interleaved: what slows one down slows all
      clear_cache(tracer);
      cold.push_back(time(tracer));
      cached.push_back(time(tracer));
      exact.push_back(time(reference));
      cold_ratios.push_back(cold.back() / exact.back());
      cached_ratios.push_back(cached.back() / exact.back());
      packets.push_back(time_camera(reference));
      packet_ratios.push_back(time_camera(tracer) / packets.back());
    }
    clear_cache(tracer);
    stats(tracer) = {};
    stats(tracer).timed = true;
    time(tracer);
    const ProxyStats phases = stats(tracer);
    stats(tracer).timed = false;
    std::vector<char> reached(proxy.quads.size(), 0);
    std::size_t found = 0;
    for (const Hit& hit : hits.read()) {
      if (hit.leaf == RBVH_NO_LEAF) continue;
      reached[hit.leaf] = 1;
      ++found;
    }
    const auto patches = std::max<std::ptrdiff_t>(1, std::count(reached.begin(), reached.end(), 1));
    std::printf(
        "| %u | %td | %.1f | %.1f, %.1f, %.1f, %.1f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f |\n",
        resolution, patches, static_cast<double>(found) / static_cast<double>(patches), phases.top * 1e3,
        phases.sort * 1e3, phases.build * 1e3, phases.cast * 1e3, median(cold), median(cached), median(exact),
        median(cold_ratios), median(cached_ratios), median(packets), median(packet_ratios));
    std::fflush(stdout);
  }
}

int run(int argc, char** argv) {
  Options options;
  CLI::App app("Measures proxies traced untessellated beside their tessellated references; prints tables");
  app.add_option("SCENE", options.scenes, "pumpkin, bark, barks, party (default: all), or none");
  app.add_option("--resolution", options.resolution, "pixels each way")->capture_default_str();
  app.add_option("--repetitions", options.repetitions, "timed tracings of each kind")->capture_default_str();
  app.add_option("--bounces", options.bounces, "indirect bounces")->capture_default_str();
  app.add_option("--cache", options.cache_mb, "MB of patch hierarchies")->capture_default_str();
  app.add_option("--reference", options.reference_mb,
                 "MB that a reference may take; larger ones are not made")
      ->capture_default_str();
  app.add_option("--few-rays", options.few_rays, "rays that are cast at a patch before it is built for them")
      ->capture_default_str();
  app.add_flag("--processor-time", counts_processor_time,
               "count processor time in place of elapsed time, but for phases: on machines with other work");
  app.add_option("--sweep-sizes", options.sweep_sizes,
                 "pixels each way of the table by rays a patch, multiples of 8")
      ->delimiter(',');
  app.add_flag("!--no-sweep", options.sweep, "leave out the table by rays a patch");
  CLI11_PARSE(app, argc, argv);
  if (options.scenes.empty()) options.scenes = {"pumpkin", "bark", "barks", "party"};
  try {
    const Device device = Device::open();
    for (const std::string& name : options.scenes)
      if (name != "none") measure(device, options, name);
    if (options.sweep) measure_rays_a_patch(device, options);
  } catch (const Error& error) {
    std::fprintf(stderr, "proxy_bench: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace rbvh::bench

int main(int argc, char** argv) { return rbvh::bench::run(argc, argv); }
