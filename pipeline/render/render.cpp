#include "pipeline/render/render.h"

#include <utility>

#include "pipeline/base/stopwatch.h"
#include "pipeline/rbvh/layer_sampling.h"
#include "pipeline/render/difference.h"

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

void add(Image& sum, const Image& image, float weight) {
  if (sum.pixels.empty()) sum = make_image(image.kind, image.width, image.height, image.channels);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) sum.pixels[i] += image.pixels[i] * weight;
}

}  // namespace

Image render(const Tracer& tracer, const Camera& camera, const RenderConfig& config, RenderTimings* timings) {
  RenderTimings unasked;
  RenderTimings& times = timings != nullptr ? *timings : unasked;
  Stopwatch watch;
  const bool is_shaded = config.aov == Aov::kShaded;
  const int samples = is_shaded ? (config.samples > 0 ? config.samples : kShadedSamples) : 1;
  Image picture;
  for (int sample = 0; sample < samples; ++sample) {
    const auto [x, y] = sample_offset(sample, samples);
    const CameraRays rays = camera_rays(camera, config.width, config.height, x, y);
    std::vector<std::uint32_t> steps;
    const std::vector<Hit> hits = intersect(tracer, rays, config.aov == Aov::kSteps ? &steps : nullptr);
    times.trace += watch.lap();
    times.rays += hits.size();
    if (is_shaded) {
      SurfaceSamples surface = tracer.surface(hits);
      if (config.colors) surface.colors = config.colors(hits);
      add(picture, shade(rays, hits, surface, config.up), 1 / static_cast<float>(samples));
    } else {
      picture = config.aov == Aov::kSteps ? steps_image(rays, steps) : data_image(config.aov, rays, hits);
      if (config.as_shown) picture = shown_image(config.aov, picture);
    }
    times.shade += watch.lap();
  }
  return picture;
}

Image render_difference(const Tracer& first, const Tracer& second, const Camera& camera, std::uint32_t width,
                        std::uint32_t height, float diagonal, std::uint64_t& differing,
                        RenderTimings* timings) {
  RenderTimings unasked;
  RenderTimings& times = timings != nullptr ? *timings : unasked;
  Stopwatch watch;
  const CameraRays rays = camera_rays(camera, width, height);
  const std::vector<Hit> a = intersect(first, rays), b = intersect(second, rays);
  times.trace += watch.lap();
  times.rays += a.size() + b.size();
  for (std::size_t i = 0; i < a.size(); ++i) differing += a[i].t != b[i].t || a[i].leaf != b[i].leaf;
  Image image = difference_image(a, b, rays, diagonal);
  times.shade += watch.lap();
  return image;
}

std::vector<Vec3f> layer_colors(const Level& level, const Layer& layer, std::span<const Hit> hits) {
  return value_colors(sample_layer_at_hits(level, layer, hits), sample_width(layer), layer.lo, layer.hi);
}

}  // namespace rbvh
