// Light that arrives at points of a surface: what a layer keeps of it.
#include <algorithm>

#include "pipeline/base/error.h"
#include "pipeline/light/path_wave.h"
#include "pipeline/light/vertex.h"

namespace rbvh {

std::vector<Vec3f> gather_light(const Tracer& tracer, std::span<const Vec3f> points,
                                std::span<const Vec3f> normals, const Environment& environment,
                                const PathConfig& config, const Progress& progress) {
  RBVH_CHECK(points.size() == normals.size() && config.samples > 0);
  const EnvironmentSampler sampler = make_sampler(environment);
  PathTrace trace{tracer, tracer, sampler, config};
  trace.from_points = true;
  std::vector<Vec3f> light(points.size());
  const std::size_t bands = (points.size() + kPathsAtOnce - 1) / kPathsAtOnce;
  for (std::size_t first = 0; first < points.size(); first += kPathsAtOnce) {
    const std::size_t count = std::min(kPathsAtOnce, points.size() - first);
    const SurfaceSamples start{{normals.begin() + static_cast<std::ptrdiff_t>(first),
                                normals.begin() + static_cast<std::ptrdiff_t>(first + count)},
                               {}};
    trace.sums.assign(count, {});
    for (int sample = 0; sample < config.samples; ++sample) {
      Wave& wave = trace.wave;
      wave.paths.assign(count, {});
      wave.rays.resize(count);
      wave.hits.resize(count);
      for (std::size_t i = 0; i < count; ++i) {
        wave.paths[i].pixel = static_cast<std::uint32_t>(i);
        wave.rays[i] = ray_onto(points[first + i], normals[first + i]);
        wave.hits[i] = hit_at(normals[first + i]);
      }
      for (int bounce = 1; bounce <= config.max_bounces && !wave.paths.empty(); ++bounce)
        step(trace, bounce == 1 ? start : tracer.surface(wave.hits, 0), sample, bounce);
      const std::size_t band = first / kPathsAtOnce;
      report(progress, "light",
             (static_cast<double>(band) + (sample + 1.) / config.samples) / static_cast<double>(bands));
    }
    for (std::size_t i = 0; i < count; ++i)
      light[first + i] =
          (trace.sums[i].direct + trace.sums[i].indirect) * (1 / static_cast<float>(config.samples));
  }
  return light;
}

}  // namespace rbvh
