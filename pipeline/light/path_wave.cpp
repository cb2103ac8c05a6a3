#include "pipeline/light/path_wave.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "pipeline/base/parallel_for.h"
#include "pipeline/base/vector_math.h"
#include "pipeline/light/sobol.h"
#include "pipeline/light/vertex.h"

namespace rbvh {
namespace {

constexpr int kSureBounces = 3;  // before roulette

float largest(Vec3f c) { return std::max({c.x, c.y, c.z}); }

/// Light that reaches a pixel at a path's bounce-th vertex, 1: the first.
void add_light(PathTrace& trace, const Path& path, Vec3f light, int bounce) {
  Sums& sum = trace.sums[path.pixel];
  if (path.on_ground) {
    sum.ground_direct += luminance(light);
    return;
  }
  Vec3f& part = bounce == 1 ? sum.direct : sum.indirect;
  part = part + light;
  sum.sample += luminance(light);
}

/// And the light of the first vertex that would.
void add_possible_light(PathTrace& trace, const Path& path, Vec3f light) {
  Sums& sum = trace.sums[path.pixel];
  (path.on_ground ? sum.ground_lit : sum.lit) += luminance(light);
}

/// The sky's weight against light sampling (balance heuristic).
float sky_weight(const EnvironmentSampler& environment, const Path& path, Vec3f direction) {
  if (path.is_mirror || environment.is_uniform) return 1;
  return path.pdf / (path.pdf + pdf(environment, direction));
}

struct Numbers {
  std::array<float, 4> light, scatter;
};

Numbers numbers_of(const PathTrace& trace, std::uint32_t pixel, int sample, int bounce) {
  const std::uint32_t seed = hash32(trace.config.seed, pixel), index = static_cast<std::uint32_t>(sample),
                      group = 2 * static_cast<std::uint32_t>(bounce);
  return {sobol_point(index, seed, group), sobol_point(index, seed, group + 1)};
}

/// Samples a light at a vertex. An inactive ray (tmax < 0) where there is nothing to gain.
void connect(PathTrace& trace, std::size_t i, const Vertex& vertex, const Numbers& numbers) {
  Wave& wave = trace.wave;
  wave.shadow_rays[i].tmax = -1;
  const EnvironmentSampler& environment = trace.environment;
  if (environment.is_uniform || environment.is_black) return;
  const LightSample light = sample_light(environment, numbers.light[0], numbers.light[1], numbers.light[2]);
  if (!(light.pdf > 0)) return;
  const Scattering scattering = evaluate(vertex.material, vertex.at, light.direction);
  if (!(largest(scattering.value) > 0)) return;
  wave.shadow_light[i] = times(times(wave.paths[i].throughput, scattering.value), light.radiance) *
                         (1 / (light.pdf + scattering.pdf));
  if (trace.config.ground && vertex.leaves_ground(*trace.config.ground, light.direction)) return;
  wave.shadow_rays[i] = vertex.leave(light.direction, false);
}

/// The path's next ray; inactive where it ends.
void scatter(PathTrace& trace, std::size_t i, const Vertex& vertex, const Numbers& numbers, int bounce) {
  Wave& wave = trace.wave;
  Path path = wave.paths[i];
  wave.next_rays[i].tmax = -1;
  const ScatterSample s =
      sample(vertex.material, vertex.at, numbers.scatter[0], numbers.scatter[1], numbers.scatter[2]);
  if (!(s.pdf > 0) || !(largest(s.weight) > 0)) return;
  path.throughput = times(path.throughput, s.weight);
  path.pdf = s.pdf;
  path.is_mirror = s.is_mirror;
  if (bounce > kSureBounces) {
    const float survival = std::min(1.f, largest(path.throughput));
    if (numbers.light[3] >= survival) return;
    path.throughput = path.throughput * (1 / survival);
  }
  wave.next_paths[i] = path;
  wave.next_rays[i] = vertex.leave(s.direction, s.is_through);
}

/// Light along the shadow rays that nothing stops.
void cast_shadows(PathTrace& trace, int bounce) {
  Wave& wave = trace.wave;
  std::size_t kept = 0;
  wave.shadow_paths.resize(wave.paths.size());
  for (std::size_t i = 0; i < wave.paths.size(); ++i) {
    if (bounce == 1 && luminance(wave.shadow_light[i]) > 0)
      add_possible_light(trace, wave.paths[i], wave.shadow_light[i]);
    if (wave.shadow_rays[i].tmax < 0) continue;
    wave.shadow_rays[kept] = wave.shadow_rays[i];
    wave.shadow_light[kept] = wave.shadow_light[i];
    wave.shadow_paths[kept++] = static_cast<std::uint32_t>(i);
  }
  wave.shadow_rays.resize(kept);
  trace.shade_seconds += trace.watch.lap();
  const std::vector<Hit>& blocked = wave.batch.cast(trace.secondary, wave.shadow_rays, RayQuery::kAny);
  trace.trace_seconds += trace.watch.lap();
  trace.cast += kept;
  for (std::size_t i = 0; i < kept; ++i)
    if (blocked[i].leaf == RBVH_NO_LEAF)
      add_light(trace, wave.paths[wave.shadow_paths[i]], wave.shadow_light[i], bounce);
}

/// What the sky sends along a path's ray, where the ray leaves the scene. Returns whether the path goes on.
bool arrive(PathTrace& trace, std::size_t i, int bounce) {
  Wave& wave = trace.wave;
  const Ray& ray = wave.rays[i];
  Path& path = wave.paths[i];
  path.ground = find_ground(trace, ray, wave.hits[i]);
  const bool leaves = wave.hits[i].leaf == RBVH_NO_LEAF && path.ground == 0;
  if (leaves || bounce == 1) {
    const Vec3f direction{ray.direction[0], ray.direction[1], ray.direction[2]};
    const Vec3f light = times(path.throughput, radiance(trace.environment, direction)) *
                        sky_weight(trace.environment, path, direction);
    if (bounce == 1) add_possible_light(trace, path, light);
    if (leaves) add_light(trace, path, light, bounce);
  }
  return !leaves && !path.on_ground;
}

/// Casts the next rays, and keeps the paths that hit something.
void cast_next(PathTrace& trace, int bounce) {
  Wave& wave = trace.wave;
  keep_active(wave.next_rays, wave.next_paths);
  std::swap(wave.rays, wave.next_rays);
  std::swap(wave.paths, wave.next_paths);
  trace.shade_seconds += trace.watch.lap();
  wave.hits = wave.batch.cast(trace.secondary, wave.rays, RayQuery::kNearest);
  trace.trace_seconds += trace.watch.lap();
  trace.cast += wave.rays.size();
  parallel_for(wave.paths.size(), kPathGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      if (!arrive(trace, i, bounce)) wave.rays[i].tmax = -1;
  });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < wave.hits.size(); ++i)
    if (wave.rays[i].tmax >= 0) wave.hits[kept++] = wave.hits[i];
  wave.hits.resize(kept);
  keep_active(wave.rays, wave.paths);
}

Vertex vertex_of(const PathTrace& trace, std::size_t i, const SurfaceSamples& surface, int bounce) {
  const Wave& wave = trace.wave;
  if (wave.paths[i].ground > 0) return make_ground_vertex(trace.config, wave.rays[i], wave.paths[i].ground);
  Vertex vertex = make_vertex(trace.config, wave.rays[i], wave.hits[i], surface, i);
  if (bounce == 1 && trace.from_points) {
    vertex.material = {};
    vertex.at.albedo = {1, 1, 1};
  }
  return vertex;
}

}  // namespace

float find_ground(const PathTrace& trace, const Ray& ray, Hit& hit) {
  const float t = trace.config.ground ? meet_ground(*trace.config.ground, ray, hit) : 0;
  if (t > 0) hit = {std::numeric_limits<float>::infinity(), {}, 0, 0, RBVH_NO_LEAF, 0};
  return t;
}

void step(PathTrace& trace, const SurfaceSamples& surface, int sample, int bounce) {
  Wave& wave = trace.wave;
  const std::size_t count = wave.paths.size();
  wave.shadow_rays.resize(count);
  wave.shadow_light.assign(count, {});
  wave.next_rays.resize(count);
  wave.next_paths.resize(count);
  parallel_for(count, kPathGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Path& path = wave.paths[i];
      const Vertex vertex = vertex_of(trace, i, surface, bounce);
      if (bounce == 1 && !path.on_ground) {
        Sums& sum = trace.sums[path.pixel];
        sum.albedo = sum.albedo + vertex.at.albedo;
        sum.normal = sum.normal + vertex.at.normal;
        sum.depth += wave.hits[i].t;
        sum.covered += 1;
      }
      const Numbers numbers = numbers_of(trace, path.pixel, sample, bounce);
      connect(trace, i, vertex, numbers);
      scatter(trace, i, vertex, numbers, bounce);
    }
  });
  cast_shadows(trace, bounce);
  cast_next(trace, bounce);
}

}  // namespace rbvh
