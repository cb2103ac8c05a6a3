// Pictures from the waves of paths that begin at a camera.
#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/light/denoise.h"
#include "pipeline/light/path_wave.h"
#include "pipeline/light/sobol.h"
#include "pipeline/light/vertex.h"

namespace rbvh {
namespace {

/// Primary rays of some rows of pixels.
void start_wave(PathTrace& trace, const CameraRays& rays, std::size_t first_row, std::size_t rows) {
  Wave& wave = trace.wave;
  CameraRays part = rays;
  part.offset_y += static_cast<float>(first_row);
  part.height = static_cast<std::uint32_t>(rows);
  const std::size_t count = rows * part.width;
  trace.shade_seconds += trace.watch.lap();
  const std::vector<Hit>& hits = wave.batch.cast(trace.primary, part);
  trace.trace_seconds += trace.watch.lap();
  trace.cast += count;
  wave.paths.clear();
  wave.rays.clear();
  wave.hits.clear();
  for (std::size_t i = 0; i < count; ++i) {
    const Ray ray = pixel_ray(part, static_cast<std::uint32_t>(i % part.width),
                              static_cast<std::uint32_t>(i / part.width));
    Hit hit = hits[i];
    Path path;
    path.ground = find_ground(trace, ray, hit);
    path.on_ground = path.ground > 0;
    if (hit.leaf == RBVH_NO_LEAF && !path.on_ground) continue;
    path.pixel = static_cast<std::uint32_t>(first_row * part.width + i);
    if (path.on_ground) trace.sums[path.pixel].ground += 1;
    wave.paths.push_back(path);
    wave.rays.push_back(ray);
    wave.hits.push_back(hit);
  }
}

void trace_sample(PathTrace& trace, const CameraRays& rays, int sample) {
  const std::size_t width = trace.config.width, height = trace.config.height;
  const std::size_t band = std::clamp<std::size_t>(kPathsAtOnce / width, 1, height);
  for (std::size_t row = 0; row < height; row += band) {
    start_wave(trace, rays, row, std::min(band, height - row));
    for (int bounce = 1; bounce <= trace.config.max_bounces && !trace.wave.paths.empty(); ++bounce) {
      const Tracer& tracer = bounce == 1 ? trace.primary : trace.secondary;
      SurfaceSamples surface = tracer.surface(trace.wave.hits, sample_spread(rays, trace.config.samples));
      if (bounce == 1 && trace.config.colors) surface.colors = trace.config.colors(trace.wave.hits);
      step(trace, surface, sample, bounce);
    }
  }
  for (Sums& sum : trace.sums) {
    sum.squares += sum.sample * sum.sample;
    sum.sample = 0;
  }
}

/// The mean standard error of the covered pixels' luminance, over their mean.
double noise_of(const std::vector<Sums>& sums, int samples) {
  if (samples < 2) return 0;
  double error = 0, mean = 0;
  for (const Sums& sum : sums) {
    if (!(sum.covered > 0)) continue;
    const double m = static_cast<double>(luminance(sum.direct + sum.indirect)) / samples;
    const double variance = std::max(0., static_cast<double>(sum.squares) / samples - m * m);
    error += std::sqrt(variance / (samples - 1));
    mean += m;
  }
  return mean > 0 ? error / mean : 0;
}

void put(Image& image, std::size_t i, Vec3f color) {
  for (int c = 0; c < 3; ++c)
    image.pixels[i * image.channels.size() + static_cast<std::size_t>(c)] = color[c];
}

/// How dark the ground's shadow is, 0 to 1.
float shadow_of(const Sums& sum) {
  return sum.ground_lit > 0 ? std::clamp(1 - sum.ground_direct / sum.ground_lit, 0.f, 1.f) : 0;
}

/// The pictures, from the sums.
void resolve(const PathTrace& trace, PathPicture& out) {
  const std::uint32_t width = trace.config.width, height = trace.config.height;
  const float weight = 1 / static_cast<float>(out.samples);
  out.color = make_image(Image::Kind::kColor, width, height, {"R", "G", "B", "A"});
  for (Image* image : {&out.direct, &out.indirect, &out.albedo})
    *image = make_image(Image::Kind::kColor, width, height, {"R", "G", "B"});
  out.shadow = make_image(Image::Kind::kShown, width, height, {"Y"});
  for (std::size_t i = 0; i < trace.sums.size(); ++i) {
    const Sums& sum = trace.sums[i];
    put(out.direct, i, sum.direct * weight);
    put(out.indirect, i, sum.indirect * weight);
    put(out.albedo, i, sum.albedo * weight);
    put(out.color, i, (sum.direct + sum.indirect) * weight);
    out.color.pixels[i * 4 + 3] = (sum.covered + sum.ground * shadow_of(sum)) * weight;
    out.shadow.pixels[i] = sum.lit > 0 ? std::clamp(1 - luminance(sum.direct) / sum.lit, 0.f, 1.f) : 0;
  }
}

std::vector<DenoiseGuide> guides_of(const std::vector<Sums>& sums, int samples) {
  std::vector<DenoiseGuide> guides(sums.size());
  const float n = static_cast<float>(samples);
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const Sums& sum = sums[i];
    if (!(sum.covered > 0)) continue;
    const float mean = luminance(sum.direct + sum.indirect) / n;
    guides[i] = {normalized(sum.normal), sum.albedo * (1 / n), sum.depth / sum.covered,
                 samples > 1 ? std::max(0.f, sum.squares / n - mean * mean) / (n - 1) : mean * mean};
  }
  return guides;
}

/// The ground's shadow, where nothing else is seen, filtered along the ground.
void denoise_shadow(const PathTrace& trace, const CameraRays& rays, Image& color) {
  const Ground& ground = *trace.config.ground;
  Image shadow = make_image(Image::Kind::kColor, color.width, color.height, {"R", "G", "B", "A"});
  std::vector<DenoiseGuide> guides(trace.sums.size());
  for (std::size_t i = 0; i < guides.size(); ++i) {
    const Sums& sum = trace.sums[i];
    if (sum.covered > 0 || !(sum.ground > 0)) continue;
    const float dark = shadow_of(sum);
    for (std::size_t c = 0; c < 3; ++c) shadow.pixels[4 * i + c] = dark;
    const Ray ray = pixel_ray(rays, static_cast<std::uint32_t>(i % color.width),
                              static_cast<std::uint32_t>(i / color.width));
    const Hit nothing{std::numeric_limits<float>::infinity(), {}, 0, 0, RBVH_NO_LEAF, 0};
    guides[i] = {
        ground.up, {1, 1, 1}, meet_ground(ground, ray, nothing), dark * (1 - dark) / sum.ground + 1e-4f};
  }
  denoise(shadow, guides);
  for (std::size_t i = 0; i < guides.size(); ++i)
    if (guides[i].depth > 0) color.pixels[4 * i + 3] = shadow.pixels[4 * i];
}

}  // namespace

Image& image_of(PathPicture& picture, Aov aov) {
  switch (aov) {
    case Aov::kAlbedo:
      return picture.albedo;
    case Aov::kShadow:
      return picture.shadow;
    case Aov::kDirect:
      return picture.direct;
    case Aov::kIndirect:
      return picture.indirect;
    default:
      return picture.color;
  }
}

PathPicture trace_paths(const Tracer& primary, const Tracer& secondary, const Camera& camera,
                        const Environment& environment, const PathConfig& config, const Progress& progress) {
  RBVH_CHECK(config.samples > 0 && config.max_bounces > 0);
  PathPicture picture;
  const EnvironmentSampler sampler = make_sampler(environment);
  PathTrace trace{primary, secondary, sampler, config};
  CameraRays rays{};
  trace.sums.resize(std::size_t{config.width} * config.height);
  double spent = 0;
  Stopwatch clock;
  for (int sample = 0; sample < config.samples; ++sample) {
    const auto offset = sobol_point(static_cast<std::uint32_t>(sample), config.seed, 0);
    rays = camera_rays(camera, config.width, config.height, static_cast<double>(offset[0]),
                       static_cast<double>(offset[1]));
    trace_sample(trace, rays, sample);
    picture.samples = sample + 1;
    spent += clock.lap();
    const double done = static_cast<double>(picture.samples) / config.samples;
    report(progress, "paths",
           config.seconds > 0 ? std::max(done, std::min(1., spent / config.seconds)) : done);
    if (config.seconds > 0 && spent >= config.seconds) break;
  }
  picture.noise = noise_of(trace.sums, picture.samples);
  resolve(trace, picture);
  if (config.denoise) denoise(picture.color, guides_of(trace.sums, picture.samples));
  if (config.denoise && config.ground) denoise_shadow(trace, rays, picture.color);
  picture.rays = trace.cast;
  picture.trace_seconds = trace.trace_seconds;
  picture.shade_seconds = trace.shade_seconds + trace.watch.lap();
  return picture;
}

}  // namespace rbvh
