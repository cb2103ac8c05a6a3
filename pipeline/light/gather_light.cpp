// Light that arrives at points of a surface: what a layer keeps of it.
#include <algorithm>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/light/path_wave.h"
#include "pipeline/light/sobol.h"
#include "pipeline/light/vertex.h"

namespace rbvh {
namespace {

/// As if a ray had come straight down on the point; its surface is white.
Ray ray_onto(Vec3f point, Vec3f normal) {
  const Vec3f from = point + normal;
  return {{from.x, from.y, from.z}, 0, {-normal.x, -normal.y, -normal.z}, 1};
}

Hit hit_at(Vec3f normal, std::uint32_t point) { return {1, {normal.x, normal.y, normal.z}, 0, 0, point, 0}; }

}  // namespace

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
        wave.hits[i] = hit_at(normals[first + i], static_cast<std::uint32_t>(i));
      }
      for (int bounce = 1; bounce <= config.max_bounces && !wave.paths.empty(); ++bounce)
        step(trace, bounce == 1 ? start : tracer.surface(wave.hits), sample, bounce);
      report(progress, "light",
             (static_cast<double>(first / kPathsAtOnce) + (sample + 1.) / config.samples) /
                 static_cast<double>(bands));
    }
    for (std::size_t i = 0; i < count; ++i)
      light[first + i] =
          (trace.sums[i].direct + trace.sums[i].indirect) * (1 / static_cast<float>(config.samples));
  }
  return light;
}

std::vector<float> gather_occlusion(const Tracer& tracer, std::span<const Vec3f> points,
                                    std::span<const Vec3f> normals, float distance, const PathConfig& config,
                                    const Progress& progress) {
  RBVH_CHECK(points.size() == normals.size() && config.samples > 0);
  std::vector<float> open(points.size());
  RayBatch batch;
  std::vector<Ray> rays;
  for (std::size_t first = 0; first < points.size(); first += kPathsAtOnce) {
    const std::size_t count = std::min(kPathsAtOnce, points.size() - first);
    rays.resize(count);
    for (int sample = 0; sample < config.samples; ++sample) {
      parallel_for(count, kPathGrain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          const std::size_t point = first + i;
          const SurfaceSamples surface{{normals[point]}, {}};
          const Vertex vertex = make_vertex(config, ray_onto(points[point], normals[point]),
                                            hit_at(normals[point], 0), surface, 0);
          const auto u = sobol_point(static_cast<std::uint32_t>(sample),
                                     hash32(config.seed, static_cast<std::uint32_t>(point)), 1);
          rays[i] = vertex.leave(rbvh::sample(Material{}, vertex.at, 0, u[0], u[1]).direction, false);
          if (distance > 0) rays[i].tmax = distance;
        }
      });
      const std::vector<Hit>& blocked = batch.cast(tracer, rays, RayQuery::kAny);
      for (std::size_t i = 0; i < count; ++i)
        if (blocked[i].leaf == RBVH_NO_LEAF) open[first + i] += 1;
      report(progress, "occlusion",
             (static_cast<double>(first) + static_cast<double>(count) * (sample + 1.) / config.samples) /
                 static_cast<double>(points.size()));
    }
  }
  for (float& value : open) value /= static_cast<float>(config.samples);
  return open;
}

}  // namespace rbvh
