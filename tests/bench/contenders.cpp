#include "tests/bench/contenders.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>

#include "rbvh/camera.h"
#include "tests/bench/bench_rays.h"

namespace rbvh::bench {
namespace {

constexpr std::uint32_t kSeed = 1;

std::size_t count_hits(const std::vector<Hit>& hits) {
  return static_cast<std::size_t>(
      std::count_if(hits.begin(), hits.end(), [](const Hit& hit) { return hit.leaf != RBVH_NO_LEAF; }));
}

}  // namespace

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

TimedRays make_timed_rays(const Device& device, const Tracer& exact, const Scan& scan,
                          std::uint32_t resolution, double bounce_offset) {
  const Bounds3f box = bounds(scan);
  const Vec3d up = scan.is_cloud() ? Vec3d{0, 0, 1} : Vec3d{0, 1, 0};
  const Camera camera = place_camera({}, {static_cast<Vec3d>(box.lo), static_cast<Vec3d>(box.hi)}, up, 1.0);
  TimedRays timed;
  timed.words = camera_rays(camera, resolution, resolution);
  timed.primary = primary_rays(timed.words);
  timed.hits = Buffer<Hit>(device, timed.primary.size());
  exact.intersect(Buffer<Ray>(device, timed.primary), timed.hits, timed.primary.size());
  const float offset = static_cast<float>(bounce_offset) * box.diagonal();
  timed.diffuse = diffuse_rays(timed.primary, timed.hits.read(), offset, kSeed);
  timed.diffuse_buffer = Buffer<Ray>(device, timed.diffuse);
  return timed;
}

void trace(const Tracer& tracer, const std::string& kind, const TimedRays& rays) {
  if (kind == "primary")
    tracer.intersect(rays.words, rays.hits);
  else
    tracer.intersect(rays.diffuse_buffer, rays.hits, rays.diffuse.size());
  tracer.device.finish();
}

Contender device_contender(const std::string& kind, const std::string& engine, const std::string& name,
                           const Tracer& tracer, const TimedRays& rays) {
  const std::size_t count = rays.of(kind).size();
  return {{kind, engine, name, count, 0, {}, 0},
          [&tracer, &rays, kind] { trace(tracer, kind, rays); },
          [&rays, count] {
            std::vector<Hit> hits(count);
            rays.hits.read(hits);
            return count_hits(hits);
          }};
}

std::vector<Contender> embree_contenders(const std::string& kind, const std::vector<EmbreeScene>& scenes,
                                         const TimedRays& rays) {
  const auto cast = std::make_shared<EmbreeRays>(rays.of(kind), kind == "primary");
  const auto hits = std::make_shared<std::vector<Hit>>();
  const std::vector<EmbreeBuild> builds = embree_builds();
  std::vector<Contender> contenders;
  for (std::size_t i = 0; i < scenes.size(); ++i)
    for (const EmbreeVariant& variant : embree_variants())
      contenders.push_back(
          {{kind, "embree", builds[i].name + " " + variant.name, cast->size(), 0, {}, 0},
           [&scene = scenes[i], mode = variant.mode, cast, hits] { scene.trace(mode, *cast, *hits); },
           [hits] { return count_hits(*hits); }});
  return contenders;
}

void run_interleaved(std::vector<Contender>& contenders, int repetitions, Report& report) {
  for (Contender& c : contenders) {
    c.trace();
    c.result.hits = c.count_hits();
  }
  for (int i = 0; i < repetitions; ++i)
    for (Contender& c : contenders) c.result.timing.seconds.push_back(seconds_of(c.trace));
  for (Contender& c : contenders) report.rays.push_back(std::move(c.result));
}

}  // namespace rbvh::bench
