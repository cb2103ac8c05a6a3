#include "rbvh/render.h"

#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/render/shade.h"
#include "pipeline/trace/camera_rays.h"

namespace rbvh {
namespace {

/// Where in the pixel the ray of a sample passes: Hammersley's points; the centre for a single one.
std::pair<double, double> sample_offset(int sample, int samples) {
  double y = 0, digit = 0.5;
  for (int bits = sample; bits > 0; bits >>= 1, digit /= 2)
    if (bits & 1) y += digit;
  double cell = 1;
  while (cell * samples > 1) cell /= 2;
  return {(sample + 0.5) / samples, y + cell / 2};
}

}  // namespace

Image render(const Tracer& tracer, const Camera& camera, const RenderConfig& config, RenderTimings* timings) {
  RBVH_CHECK(!is_of_light(config.aov));
  RenderTimings unasked;
  RenderTimings& times = timings != nullptr ? *timings : unasked;
  Stopwatch watch;
  const bool is_shaded = config.aov == Aov::kShaded;
  const int samples = is_shaded ? (config.samples > 0 ? config.samples : kShadedSamples) : 1;
  Image picture;
  CameraHits cast;  // of each sample in turn
  if (is_shaded) picture = make_image(Image::Kind::kColor, config.width, config.height, {"R", "G", "B", "A"});
  for (int sample = 0; sample < samples; ++sample) {
    const auto [x, y] = sample_offset(sample, samples);
    const CameraRays rays = camera_rays(camera, config.width, config.height, x, y);
    intersect(tracer, rays, config.aov == Aov::kSteps, cast);
    const std::vector<Hit>& hits = cast.hits;
    times.trace += watch.lap();
    times.rays += hits.size();
    if (is_shaded) {
      for (const Band band : bands(tracer, config.width, config.height)) {
        const auto shown = std::span(hits).subspan(band.first * config.width, band.rows * config.width);
        SurfaceSamples surface = tracer.surface(shown, sample_spread(rays, samples));
        if (config.colors) surface.colors = config.colors(shown);
        add_shaded(rays, hits, band, surface, config.up, 1 / static_cast<float>(samples), picture);
      }
    } else {
      picture =
          config.aov == Aov::kSteps ? steps_image(rays, cast.steps) : data_image(config.aov, rays, hits);
      if (config.as_shown) picture = shown_image(config.aov, picture);
    }
    times.shade += watch.lap();
  }
  return picture;
}

}  // namespace rbvh
