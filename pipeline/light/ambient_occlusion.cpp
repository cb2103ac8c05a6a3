// How much of the sky is seen: from a picture's surface, and from points.
#include <algorithm>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/light/path_wave.h"
#include "pipeline/light/sobol.h"
#include "pipeline/light/vertex.h"

namespace rbvh {
namespace {

/// A ray into the sky that the vertex sees, by cosine. `stream`: each has its own points.
Ray sky_ray(const Vertex& vertex, float distance, std::uint32_t seed, std::uint32_t stream, int sample) {
  const auto u = sobol_point(static_cast<std::uint32_t>(sample), hash32(seed, stream), 1);
  Ray ray = vertex.leave(rbvh::sample(Material{}, vertex.at, 0, u[0], u[1]).direction, false);
  if (distance > 0) ray.tmax = distance;
  return ray;
}

}  // namespace

Image trace_ambient_occlusion(const Tracer& primary, const Tracer& secondary, const Camera& camera,
                              float distance, const PathConfig& config, const Progress& progress) {
  Image picture = make_image(Image::Kind::kShown, config.width, config.height, {"Y"});
  std::vector<float> covered(picture.pixels.size());
  RayBatch primary_batch, batch;
  for (int sample = 0; sample < config.samples; ++sample) {
    const auto offset = sobol_point(static_cast<std::uint32_t>(sample), config.seed, 0);
    const CameraRays rays = camera_rays(camera, config.width, config.height, static_cast<double>(offset[0]),
                                        static_cast<double>(offset[1]));
    const std::vector<Hit>& hits = primary_batch.cast(primary, rays);
    const SurfaceSamples surface = primary.surface(hits, 0);
    std::vector<Ray> open(hits.size());
    parallel_for(hits.size(), kPathGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        open[i].tmax = -1;
        if (hits[i].leaf == RBVH_NO_LEAF) continue;
        const auto pixel = static_cast<std::uint32_t>(i);
        const Ray ray = pixel_ray(rays, pixel % rays.width, pixel / rays.width);
        open[i] =
            sky_ray(make_vertex(config, ray, hits[i], surface, i), distance, config.seed, pixel, sample);
      }
    });
    std::vector<std::uint32_t> pixels(hits.size());
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<std::uint32_t>(i);
    keep_active(open, pixels);
    const std::vector<Hit>& blocked = batch.cast(secondary, open, RayQuery::kAny);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      covered[pixels[i]] += 1;
      if (blocked[i].leaf == RBVH_NO_LEAF) picture.pixels[pixels[i]] += 1;
    }
    report(progress, "occlusion", static_cast<double>(sample + 1) / config.samples);
  }
  for (std::size_t i = 0; i < covered.size(); ++i)
    picture.pixels[i] = covered[i] > 0 ? picture.pixels[i] / covered[i] : 1;
  return picture;
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
          rays[i] = sky_ray(make_vertex(config, ray_onto(points[point], normals[point]),
                                        hit_at(normals[point]), surface, 0),
                            distance, config.seed, static_cast<std::uint32_t>(point), sample);
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
