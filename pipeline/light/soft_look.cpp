#include "pipeline/light/soft_look.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/base/vector_math.h"
#include "pipeline/light/a_trous.h"
#include "pipeline/light/path_wave.h"
#include "pipeline/light/sobol.h"
#include "pipeline/light/vertex.h"
#include "pipeline/render/shade.h"

namespace rbvh {
namespace {

constexpr std::size_t kRows = 8;
constexpr float kKeyRadius = 0.2f;  // of the key light, as seen: tangent of 11 degrees
constexpr int kFewSamples = 4, kManySamples = 16;
constexpr std::uint64_t kManyPixels = 400'000;
constexpr int kFilterSteps = 3;
constexpr float kDepthSlope = 3, kLeastDepth = 1e-3f;
constexpr float kExposure = 1.3f;  // for what shadows take, and the filmic curve
constexpr float kOutline = 0.5f;   // how dark outlines are
constexpr float kDarkest = 0.12f;  // of what is lit from all around: no hollow is black

/// What is known of a pixel, over all samples.
struct Lighting {
  float key = 0, open = 0;  // parts of the rays that met nothing
  float count = 0;          // of samples that hit
  float depth = 0;
  Vec3f normal{};
};

/// The two rays that leave each hit of a band.
struct LightRays {
  std::vector<Ray> rays;              // to the key light, then to all around
  std::vector<std::uint32_t> pixels;  // twice
};

Vec3f towards(Vec3f axis, float radius, float u, float v) {
  Vec3f x, y;
  make_frame(axis, x, y);
  const float r = radius * std::sqrt(u), turn = 6.2831853f * v;
  return normalized(axis + x * (r * std::cos(turn)) + y * (r * std::sin(turn)));
}

Ray unused_ray() { return {{0, 0, 0}, 0, {0, 0, 1}, -1}; }

/// `hits` and `surface` are of the band that begins at `first`, a pixel.
void add_light_rays(const CameraRays& rays, std::span<const Hit> hits, std::size_t first,
                    const SurfaceSamples& surface, const SoftLook& look, int sample,
                    std::vector<Lighting>& lighting, LightRays& out) {
  const Vec3f key = to_key_light(rays);
  PathConfig config;
  config.offset = look.offset;
  out.rays.resize(2 * hits.size());
  out.pixels.resize(out.rays.size());
  parallel_for(hits.size(), kPathGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Ray& to_key = out.rays[2 * i];
      Ray& to_sky = out.rays[2 * i + 1];
      to_key = to_sky = unused_ray();
      const auto pixel = static_cast<std::uint32_t>(first + i);
      out.pixels[2 * i] = pixel;
      out.pixels[2 * i + 1] = pixel | (1u << 31);
      if (hits[i].leaf == RBVH_NO_LEAF) continue;
      const Ray ray = pixel_ray(rays, pixel % rays.width, pixel / rays.width);
      const Vertex vertex = make_vertex(config, ray, hits[i], surface, i);
      const auto u = sobol_point(static_cast<std::uint32_t>(sample), hash32(pixel), 1);
      const Vec3f to_light = towards(key, kKeyRadius, u[0], u[1]);
      if (dot(vertex.at.geometric, to_light) > 0) to_key = vertex.leave(to_light, false);
      to_sky = vertex.leave(rbvh::sample(Material{}, vertex.at, 0, u[2], u[3]).direction, false);
      if (look.reach > 0) to_sky.tmax = look.reach;
      Lighting& at = lighting[pixel];
      at.count += 1;
      at.depth += hits[i].t;
      at.normal = at.normal + vertex.at.normal;
    }
  });
  keep_active(out.rays, out.pixels);
}

void add_found(std::span<const Hit> blocked, const LightRays& cast, std::vector<Lighting>& lighting) {
  for (std::size_t i = 0; i < cast.pixels.size(); ++i) {
    if (blocked[i].leaf != RBVH_NO_LEAF) continue;
    Lighting& at = lighting[cast.pixels[i] & ~(1u << 31)];
    (cast.pixels[i] >> 31 ? at.open : at.key) += 1;
  }
}

/// One step of an edge-avoiding a-trous filter of `key` and `open`.
void filter(const std::vector<Lighting>& in, std::vector<Lighting>& out, std::ptrdiff_t width,
            std::ptrdiff_t height, std::ptrdiff_t spacing, float pixel_angle) {
  parallel_for(static_cast<std::size_t>(height), kRows, [&](std::size_t begin, std::size_t end) {
    for (auto y = static_cast<std::ptrdiff_t>(begin); y < static_cast<std::ptrdiff_t>(end); ++y)
      for (std::ptrdiff_t x = 0; x < width; ++x) {
        const auto i = static_cast<std::size_t>(y * width + x);
        const Lighting& own = in[i];
        out[i] = own;
        if (!(own.count > 0)) continue;
        const float scale =
            1 / (own.depth * (kDepthSlope * pixel_angle * static_cast<float>(spacing) + kLeastDepth));
        float key = 0, open = 0, sum = 0;
        for_each_tap(width, height, x, y, spacing, [&](std::size_t tap, float spline) {
          const Lighting& other = in[tap];
          const float apart = std::abs(other.depth - own.depth) * scale,
                      alike = dot(own.normal, other.normal);
          if (!(other.count > 0) || !(apart < 1) || !(alike > 0)) return;
          const float a2 = alike * alike, a8 = a2 * a2 * a2 * a2;
          const float w = spline * (1 - apart) * a8;
          key += other.key * w;
          open += other.open * w;
          sum += w;
        });
        if (!(sum > 0)) continue;
        out[i].key = key / sum;
        out[i].open = open / sum;
      }
  });
}

/// How far a pixel lies behind those around it, as a factor of its light.
float outline(const std::vector<Lighting>& lighting, std::ptrdiff_t width, std::ptrdiff_t height,
              std::ptrdiff_t x, std::ptrdiff_t y) {
  const float own = lighting[static_cast<std::size_t>(y * width + x)].depth;
  const std::ptrdiff_t radius = std::max<std::ptrdiff_t>(1, height / 512);
  float behind = 0;
  for (const auto& [dx, dy] :
       {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1}}) {
    const std::ptrdiff_t nx = x + dx * radius, ny = y + dy * radius;
    if (nx < 0 || ny < 0 || nx >= width || ny >= height) continue;
    const Lighting& other = lighting[static_cast<std::size_t>(ny * width + nx)];
    if (other.count > 0 && own > other.depth) behind += std::min(1.f, 30 * (own - other.depth) / own);
  }
  return 1 - kOutline * behind / 8;
}

void compose(const std::vector<Lighting>& lighting, const Image& by_key, bool outlines, Image& picture) {
  const auto width = static_cast<std::ptrdiff_t>(picture.width),
             height = static_cast<std::ptrdiff_t>(picture.height);
  parallel_for(picture.height, kRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin * picture.width; i < end * picture.width; ++i) {
      const Lighting& at = lighting[i];
      if (!(at.count > 0)) continue;
      const auto x = static_cast<std::ptrdiff_t>(i) % width, y = static_cast<std::ptrdiff_t>(i) / width;
      const float line = kExposure * (outlines ? outline(lighting, width, height, x, y) : 1);
      const float open = kDarkest + (1 - kDarkest) * at.open;
      for (std::size_t c = 0; c < 3; ++c)
        picture.pixels[4 * i + c] =
            line * (picture.pixels[4 * i + c] * open + by_key.pixels[3 * i + c] * at.key);
    }
  });
}

}  // namespace

int soft_samples(std::uint32_t width, std::uint32_t height) {
  return std::uint64_t{width} * height <= kManyPixels ? kManySamples : kFewSamples;
}

Image render_soft(const Tracer& primary, const Tracer& secondary, const Camera& camera,
                  const RenderConfig& config, const SoftLook& look, RenderTimings& timings,
                  const Progress& progress) {
  const int samples = config.samples > 0 ? config.samples : soft_samples(config.width, config.height);
  Stopwatch watch;
  Image picture = make_image(Image::Kind::kColor, config.width, config.height, {"R", "G", "B", "A"});
  Image by_key = make_image(Image::Kind::kColor, config.width, config.height, {"R", "G", "B"});
  std::vector<Lighting> lighting(std::size_t{config.width} * config.height);
  RayBatch seen, light;
  LightRays rays_out;
  float pixel_angle = 0;
  for (int sample = 0; sample < samples; ++sample) {
    const auto offset = sobol_point(static_cast<std::uint32_t>(sample), 0, 0);
    const CameraRays rays = camera_rays(camera, config.width, config.height, static_cast<double>(offset[0]),
                                        static_cast<double>(offset[1]));
    pixel_angle = length(array3(rays.up));
    const std::vector<Hit>& hits = seen.cast(primary, rays);
    timings.trace += watch.lap();
    timings.rays += hits.size();
    for (const Band band : bands(secondary, config.width, config.height)) {
      const std::size_t first = band.first * config.width;
      const auto shown = std::span(hits).subspan(first, band.rows * config.width);
      SurfaceSamples surface = primary.surface(shown, sample_spread(rays, samples));
      if (config.colors) surface.colors = config.colors(shown);
      add_shaded(rays, hits, band, surface, config.up, 1 / static_cast<float>(samples), picture, &by_key);
      add_light_rays(rays, shown, first, surface, look, sample, lighting, rays_out);
      timings.shade += watch.lap();
      add_found(light.cast(secondary, rays_out.rays, RayQuery::kAny), rays_out, lighting);
      timings.trace += watch.lap();
      timings.rays += rays_out.rays.size();
    }
    report(progress, "light", static_cast<double>(sample + 1) / samples);
  }
  for (Lighting& at : lighting) {
    if (!(at.count > 0)) continue;
    at.key /= at.count;
    at.open /= at.count;
    at.depth /= at.count;
    at.normal = normalized(at.normal);
  }
  std::vector<Lighting> next(lighting.size());
  for (int step = 0; step < kFilterSteps; ++step) {
    filter(lighting, next, config.width, config.height, 1 << step, pixel_angle);
    std::swap(lighting, next);
  }
  compose(lighting, by_key, look.outlines, picture);
  timings.shade += watch.lap();
  return picture;
}

}  // namespace rbvh
