// Measures ray tracing proxies untessellated beside their tessellated twins traced exactly: memory (table 1.1 of Harada,
// "Rendering Vector Displacement Mapped Surfaces in a GPU Ray Tracer", GPU Pro 6), time by phase for primary, shadow and
// bounced rays (figures 1.7, 1.9, 1.10), and time by rays a patch. The scenes are made here, after the source's four:
// one pumpkin, one bark, seven barks, and a party of both. Writes figures down; passes and fails nothing.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <numbers>
#include <optional>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/exact/trace_exact.h"
#include "pipeline/proxy/tessellate.h"
#include "pipeline/proxy/trace_proxy.h"
#include "pipeline/render/camera.h"
#include "tests/bench/bench_rays.h"
#include "tests/proxy_shapes.h"

namespace rbvh::bench {
namespace {

struct Options {
  std::vector<std::string> scenes;
  std::uint32_t resolution = 1024;
  int repetitions = 3, bounces = 5;
  std::size_t cache_mb = 512, twin_mb = 3000;
  bool sweep = true;
};

struct BenchScene {
  std::string name;
  Proxy proxy;
  double triangles = 0;  ///< of the twin at the tiles' own levels
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
  return out * (0.07f * plates) + around * (0.05f * std::cos(14 * angle + 5 * wander) * std::max(plates, 0.0f)) +
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
  for (const Quad& q : one.quads) all.quads.push_back({q[0] + first, q[1] + first, q[2] + first, q[3] + first});
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
    throw Error(ExitCode::kUsage, {}, "'" + name + "' is none of pumpkin, bark, barks, party");
  }
  for (const PatchTile& tile : scene.proxy.tiles)
    scene.triangles += 2.0 * (tile.side - 1) * (tile.side - 1);
  return scene;
}

double seconds_of(const Device& device, const std::function<void()>& work) {
  device.finish();
  const auto start = std::chrono::steady_clock::now();
  work();
  device.finish();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// --- rays -----------------------------------------------------------------------------------------------------------

/// One kind of rays, cast by one tracer.
struct Row {
  std::string rays;
  std::size_t count = 0, hits = 0;
  double total = 0, top = 0, sort = 0, build = 0, cast = 0;  ///< milliseconds
  double built = 0, leaves = 0, pairs = 0;
};

template <class Tracer>
std::vector<Hit> cast(const Tracer& tracer, const std::vector<Ray>& rays, RayQuery query, Row& row,
                      const std::function<void()>& before, int repetitions) {
  const Buffer<Ray> ray_buffer(tracer.device, rays);
  const Buffer<Hit> hits(tracer.device, rays.size());
  std::vector<double> seconds;
  for (int i = 0; i < repetitions; ++i) {
    before();
    seconds.push_back(seconds_of(
        tracer.device, [&] { trace_rays(tracer, ray_buffer, hits, rays.size(), query); }));
  }
  row.count = rays.size();
  row.total = median(seconds) * 1e3;
  std::vector<Hit> found = hits.read();
  for (const Hit& hit : found) row.hits += hit.leaf != RBVH_NO_LEAF;
  return found;
}

using CastRays = std::function<std::vector<Hit>(const std::vector<Ray>&, RayQuery, Row&)>;

/// Primary rays, shadow rays to the sky, and bounces.
std::vector<Row> cast_all(const CameraRays& camera, float offset, int bounces, const CastRays& cast_rays) {
  std::vector<Row> rows;
  std::vector<Ray> rays = primary_rays(camera);
  rows.push_back({"primary"});
  std::vector<Hit> hits = cast_rays(rays, RayQuery::kNearest, rows.back());
  rows.push_back({"shadow"});
  cast_rays(diffuse_rays(rays, hits, offset, 77), RayQuery::kAny, rows.back());
  for (int bounce = 1; bounce <= bounces; ++bounce) {
    rays = diffuse_rays(rays, hits, offset, static_cast<std::uint32_t>(bounce));
    if (rays.empty()) break;
    rows.push_back({"bounce " + std::to_string(bounce)});
    hits = cast_rays(rays, RayQuery::kNearest, rows.back());
  }
  return rows;
}

double ns_per_ray(const Row& row) { return row.total * 1e6 / static_cast<double>(std::max<std::size_t>(1, row.count)); }

void print_rows(const std::vector<Row>& rows, const std::vector<Row>& twin) {
  std::printf("| Rays | count | top, middle [ms] | sort | build | patches | total | ns a ray | pairs a ray | built | leaves | twin [ms] | twin ns a ray | direct / twin |\n"
              "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& r = rows[i];
    std::printf("| %s | %zu | %.1f | %.1f | %.1f | %.1f | %.1f | %.0f | %.2f | %.0f | %.0f |", r.rays.c_str(), r.count, r.top, r.sort,
                r.build, r.cast, r.total, ns_per_ray(r), r.pairs / static_cast<double>(std::max<std::size_t>(1, r.count)), r.built, r.leaves);
    if (i < twin.size())
      std::printf(" %.1f | %.0f | %.2f |\n", twin[i].total, ns_per_ray(twin[i]), ns_per_ray(r) / ns_per_ray(twin[i]));
    else
      std::printf(" - | - | - |\n");
  }
  std::fflush(stdout);
}

CameraRays make_camera(const Bounds3f& box, std::uint32_t resolution) {
  Bounds3d bounds{static_cast<Vec3d>(box.lo), static_cast<Vec3d>(box.hi)};
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
  ProxyTracer tracer;
  const double prepare = seconds_of(device, [&] { tracer = make_proxy_tracer(device, scene.proxy, config); });
  const Bounds3f box = box_of(scene.proxy);
  const CameraRays camera = make_camera(box, options.resolution);
  const float offset = 1e-4f * box.diagonal();
  set_detail(tracer, camera);
  const ProxyBytes memory = bytes(tracer);

  std::optional<ExactTracer> twin;
  double twin_bytes = 0, twin_seconds = 0;
  const double estimate = scene.triangles * 80;
  if (estimate < static_cast<double>(options.twin_mb) * 1e6) {
    twin_seconds = seconds_of(device, [&] {
      const Scan mesh = tessellate(scene.proxy, kLevel);
      twin_bytes = static_cast<double>(mesh.positions.size() * sizeof(Vec3f) + mesh.triangles.size() * sizeof(Triangle));
      twin = make_exact_tracer(device, mesh);
    });
    twin_bytes += static_cast<double>(twin->bytes());
  }
  std::printf("\n## %s: %zu patches, %.1f M triangles tessellated; prepared in %.2f s (twin: %.1f s)\n\n", name.c_str(),
              scene.proxy.quads.size(), scene.triangles * 1e-6, prepare, twin_seconds);
  std::printf("tessellated %.1f MB (%.1f bytes a triangle), direct %.3f MB without maps, %.1f MB maps; cache limit %.0f MB\n\n",
              twin_bytes * 1e-6, twin_bytes / scene.triangles, static_cast<double>(memory.base) * 1e-6,
              static_cast<double>(memory.maps) * 1e-6, static_cast<double>(memory.cache) * 1e-6);

  const auto direct = [&](bool keep) {
    return [&tracer, &options, keep](const std::vector<Ray>& rays, RayQuery query, Row& row) {
      const auto forget = [&] {
        if (!keep) clear_cache(tracer);
      };
      stats(tracer) = {};
      std::vector<Hit> hits = cast(tracer, rays, query, row, forget, keep ? 1 : options.repetitions);
      // Again by phase: waiting between them costs a little.
      Row timed;
      if (!keep) {
        forget();
        stats(tracer) = {};
        stats(tracer).timed = true;
        cast(tracer, rays, query, timed, forget, 1);
        const ProxyStats& s = stats(tracer);
        row.top = s.top * 1e3, row.sort = s.sort * 1e3, row.build = s.build * 1e3, row.cast = s.cast * 1e3;
      }
      row.pairs = static_cast<double>(stats(tracer).pairs);
      row.built = static_cast<double>(stats(tracer).built);
      row.leaves = static_cast<double>(stats(tracer).built_leaves);
      stats(tracer).timed = false;
      return hits;
    };
  };
  std::vector<Row> twin_rows;
  if (twin)
    twin_rows = cast_all(camera, offset, options.bounces, [&](const std::vector<Ray>& rays, RayQuery query, Row& row) {
      return cast(*twin, rays, query, row, [] {}, options.repetitions);
    });
  cast_all(make_camera(box, 64), offset, 1, direct(false));  // compiles
  std::printf("Nothing kept, each cast builds what it needs:\n\n");
  const std::vector<Row> cold = cast_all(camera, offset, options.bounces, direct(false));
  print_rows(cold, twin_rows);
  clear_cache(tracer);
  std::printf("\nWith the cache, from an empty one on:\n\n");
  print_rows(cast_all(camera, offset, options.bounces, direct(true)), twin_rows);
  std::printf("\nThe next frame:\n\n");
  const std::vector<Row> warm = cast_all(camera, offset, options.bounces, direct(true));
  print_rows(warm, twin_rows);
  if (warm.size() > 6)
    std::printf("\na ray at bounce 5 costs %.2f of one at bounce 1; in the cache: %.1f MB\n", ns_per_ray(warm[6]) / ns_per_ray(warm[2]),
                static_cast<double>(bytes(tracer).cached) * 1e-6);

}

// Many patches, so that few rays a patch are still many rays.
void measure_rays_a_patch(const Device& device, const Options& options) {
  constexpr std::uint32_t kGlobeLevel = 5;
  const Proxy proxy = displaced(quad_sphere(32), std::span(&kGlobeLevel, 1),
                                [](Vec3f p) { return mushrooms(p, 0.05f) + ripples(p, 90, 3) * 0.002f; });
  ProxyConfig config;
  config.cache_bytes = options.cache_mb << 20;
  const ProxyTracer tracer = make_proxy_tracer(device, proxy, config);
  const Scan mesh = tessellate(proxy, kGlobeLevel);
  const ExactTracer twin = make_exact_tracer(device, mesh);
  std::printf(
      "\n## By rays a patch: %zu patches, %.1f M triangles tessellated\n\n"
      "| image | patches reached | rays a patch | top, sort, build, patches [ms] | direct, cold [ms] | direct, cached [ms] | twin [ms] | cold / twin | "
      "cached / twin |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
      proxy.quads.size(), static_cast<double>(mesh.triangles.size()) * 1e-6);
  for (const std::uint32_t resolution : {64u, 104u, 144u, 200u, 288u, 408u, 576u, 816u, 1152u, 1632u}) {
    const CameraRays camera = make_camera(box_of(proxy), resolution);
    set_detail(tracer, camera);
    const std::vector<Ray> rays = primary_rays(camera);
    const Buffer<Ray> ray_buffer(device, rays);
    const Buffer<Hit> hits(device, rays.size());
    const auto time = [&](const auto& with) {
      return 1e3 * seconds_of(device, [&] { trace_rays(with, ray_buffer, hits, rays.size(), RayQuery::kNearest); });
    };
    std::vector<double> cold, cached, exact, cold_ratios, cached_ratios;
    time(twin);
    for (int i = 0; i < 2 * options.repetitions + 1; ++i) {  // in turn: what slows one down slows all
      clear_cache(tracer);
      cold.push_back(time(tracer));
      cached.push_back(time(tracer));
      exact.push_back(time(twin));
      cold_ratios.push_back(cold.back() / exact.back());
      cached_ratios.push_back(cached.back() / exact.back());
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
    std::printf("| %u | %td | %.1f | %.1f, %.1f, %.1f, %.1f | %.2f | %.2f | %.2f | %.2f | %.2f |\n", resolution, patches,
                static_cast<double>(found) / static_cast<double>(patches), phases.top * 1e3,
                phases.sort * 1e3, phases.build * 1e3, phases.cast * 1e3, median(cold), median(cached), median(exact),
                median(cold_ratios), median(cached_ratios));
    std::fflush(stdout);
  }
}

int run(int argc, char** argv) {
  Options options;
  CLI::App app("Measures proxies traced untessellated beside their tessellated twins; prints tables");
  app.add_option("SCENE", options.scenes, "pumpkin, bark, barks, party (default: all), or none");
  app.add_option("--resolution", options.resolution, "pixels each way")->capture_default_str();
  app.add_option("--repetitions", options.repetitions, "timed tracings of each kind")->capture_default_str();
  app.add_option("--bounces", options.bounces, "indirect bounces")->capture_default_str();
  app.add_option("--cache", options.cache_mb, "MB of patch hierarchies")->capture_default_str();
  app.add_option("--twin", options.twin_mb, "MB that a twin may take; larger ones are not made")->capture_default_str();
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
    return static_cast<int>(error.code());
  }
  return 0;
}

}  // namespace
}  // namespace rbvh::bench

int main(int argc, char** argv) { return rbvh::bench::run(argc, argv); }
