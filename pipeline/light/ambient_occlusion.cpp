// How much of the sky is seen: from a picture's surface, and from points.
#include "pipeline/base/parallel_for.h"
#include "pipeline/light/path_wave.h"
#include "pipeline/light/sobol.h"
#include "pipeline/light/vertex.h"

namespace rbvh {

Image trace_ambient_occlusion(const Tracer& primary, const Tracer& secondary, const Camera& camera,
                              float distance, const PathConfig& config, const Progress& progress) {
  // The light of a uniform sky that comes directly, with rays that end after `distance`.
  PathConfig one_bounce = config;
  one_bounce.max_bounces = 1;
  Image picture = make_image(Image::Kind::kShown, config.width, config.height, {"Y"});
  std::vector<float> covered(picture.pixels.size());
  RayBatch primary_batch, batch;
  for (int sample = 0; sample < config.samples; ++sample) {
    const auto offset = sobol_point(static_cast<std::uint32_t>(sample), config.seed, 0);
    const CameraRays rays = camera_rays(camera, config.width, config.height, static_cast<double>(offset[0]),
                                        static_cast<double>(offset[1]));
    const std::vector<Hit>& hits = primary_batch.cast(primary, rays);
    const SurfaceSamples surface = primary.surface(hits);
    std::vector<Ray> open(hits.size());
    parallel_for(hits.size(), kPathGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        open[i].tmax = -1;
        if (hits[i].leaf == RBVH_NO_LEAF) continue;
        const auto pixel = static_cast<std::uint32_t>(i);
        const Ray ray = pixel_ray(rays, pixel % rays.width, pixel / rays.width);
        const Vertex vertex = make_vertex(one_bounce, ray, hits[i], surface, i);
        const auto numbers = sobol_point(static_cast<std::uint32_t>(sample), hash32(config.seed, pixel), 1);
        open[i] =
            vertex.leave(rbvh::sample(Material{}, vertex.at, 0, numbers[0], numbers[1]).direction, false);
        if (distance > 0) open[i].tmax = distance;
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

}  // namespace rbvh
