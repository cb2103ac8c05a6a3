#include "pipeline/render/shade.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/vector_math.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/scan/vertex_normals.h"
#include "pipeline/trace/camera_rays.h"
#include "rbvh/camera.h"

namespace rbvh {
namespace {

constexpr std::size_t kRows = 8;

// The look. Colours are linear light.
constexpr Vec3f kBackTint{0.55f, 0.60f, 0.70f};  // the inside of a surface is darker and cooler
constexpr Vec3f kKey{0.92f, 0.88f, 0.82f}, kSky{0.34f, 0.39f, 0.47f}, kGround{0.08f, 0.07f, 0.06f};
constexpr float kFill = 0.10f, kBoundary = 0.16f, kGloss = 0.06f, kGlossExponent = 24;
constexpr float kValley = 0.45f, kRidge = 0.25f;

constexpr float kPixelsAtWhichReliefIsSought[] = {1, 2.5f, 6};  // for 1024 rows

bool is_hit(const Hit& hit) { return std::isfinite(hit.t); }
Vec3f mix(Vec3f a, Vec3f b, float t) { return a * (1 - t) + b * t; }

// How far a pixel lies in a valley (positive) or on a ridge (negative): the mean of opposite pixels' 1/t
// against its own, which is zero on any plane, in units of the slope that makes. About [-1, 1]; steps in
// depth are cut off.
// `halves` are 0.5 / t, 0 where nothing is hit, from row `first_row` on.
float relief(std::span<const float> halves, std::size_t first_row, float t, std::size_t width,
             std::size_t height, std::size_t x, std::size_t y, int radius, float pixel_angle) {
  if (!(t > 0)) return 0;
  const float inverse = 1 / t;
  const std::ptrdiff_t w = static_cast<std::ptrdiff_t>(width), h = static_cast<std::ptrdiff_t>(height);
  const std::ptrdiff_t px = static_cast<std::ptrdiff_t>(x), py = static_cast<std::ptrdiff_t>(y);
  constexpr std::ptrdiff_t kDirections[4][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};
  float sum = 0;
  for (const auto& [dx, dy] : kDirections) {
    const std::ptrdiff_t ax = px + dx * radius, ay = py + dy * radius, bx = px - dx * radius,
                         by = py - dy * radius;
    if (std::min(ax, bx) < 0 || std::max(ax, bx) >= w || std::min(ay, by) < 0 || std::max(ay, by) >= h)
      continue;
    const auto half = [&](std::ptrdiff_t hx, std::ptrdiff_t hy) {
      return halves[static_cast<std::size_t>((hy - static_cast<std::ptrdiff_t>(first_row)) * w + hx)];
    };
    const float a = half(ax, ay), b = half(bx, by);
    if (a == 0 || b == 0) continue;
    const float bend = (a + b - inverse) * t / (pixel_angle * static_cast<float>(radius));
    sum += std::clamp(bend, -1.f, 1.f);
  }
  return sum / 4;
}

struct Lights {
  Vec3f key, up;
};

struct Lit {
  Vec3f key, rest;  // by the key light; by all around
};

Lit light(Vec3f albedo, Vec3f normal, Vec3f view, const Lights& lights) {
  const float facing = std::clamp(dot(normal, view), 0.f, 1.f);
  const float key = std::max(0.f, dot(normal, lights.key));
  const Vec3f sky = mix(kGround, kSky, 0.5f + 0.5f * dot(normal, lights.up));
  const Vec3f halfway = normalized(lights.key + view);
  const float gloss = kGloss * std::pow(std::max(0.f, dot(normal, halfway)), kGlossExponent);
  const float away = 1 - facing;
  return {times(albedo, kKey * key) + kKey * gloss,
          times(albedo, sky + Vec3f{kFill, kFill, kFill} * facing) + sky * (kBoundary * away * away * away)};
}

// Fully saturated, well apart for neighbouring numbers.
Vec3f distinct_color(std::uint32_t n) {
  n = (n ^ (n >> 16)) * 0x7feb352du;
  n = (n ^ (n >> 15)) * 0x846ca68bu;
  n ^= n >> 16;
  const auto channel = [n](int shift) { return 0.2f + 0.75f * static_cast<float>((n >> shift) & 255) / 255; };
  return {channel(0), channel(8), channel(16)};
}

// Dark blue, teal, green, yellow: like viridis, even to the eye.
Vec3f ramp(float t) {
  static const Vec3f kStops[] = {{0.267f, 0.005f, 0.329f},
                                 {0.231f, 0.322f, 0.545f},
                                 {0.129f, 0.569f, 0.549f},
                                 {0.369f, 0.788f, 0.384f},
                                 {0.993f, 0.906f, 0.144f}};
  const float at = std::clamp(t, 0.f, 1.f) * 4;
  const std::size_t i = std::min<std::size_t>(3, static_cast<std::size_t>(at));
  return mix(kStops[i], kStops[i + 1], at - static_cast<float>(i));
}

void put(float* pixel, Vec3f color) {
  pixel[0] = color.x;
  pixel[1] = color.y;
  pixel[2] = color.z;
}

}  // namespace

std::optional<Aov> find_aov(std::string_view name) {
  static const std::pair<std::string_view, Aov> kNames[] = {
      {"shaded", Aov::kShaded},     {"normal", Aov::kNormal},    {"depth", Aov::kDepth},
      {"position", Aov::kPosition}, {"leaf", Aov::kLeaf},        {"steps", Aov::kSteps},
      {"ao", Aov::kOcclusion},      {"albedo", Aov::kAlbedo},    {"shadow", Aov::kShadow},
      {"direct", Aov::kDirect},     {"indirect", Aov::kIndirect}};
  for (const auto& [known, aov] : kNames)
    if (name == known) return aov;
  return std::nullopt;
}

Vec3f to_key_light(const CameraRays& rays) {
  const Vec3f forward = pixel_direction(rays, rays.width / 2, rays.height / 2);
  const Vec3f image_up = -normalized(array3(rays.up)), image_right = normalized(array3(rays.right));
  return normalized(forward * -0.75f + image_up * 0.5f - image_right * 0.4f);
}

std::vector<Band> bands(const Tracer& tracer, std::size_t width, std::size_t height) {
  if (tracer.is_on_demand()) return {{0, height}};
  constexpr std::size_t kPixels = 1 << 17;
  const std::size_t rows = std::max<std::size_t>(kRows, kPixels / std::max<std::size_t>(1, width));
  std::vector<Band> all;
  for (std::size_t first = 0; first < height; first += rows)
    all.push_back({first, std::min(rows, height - first)});
  return all;
}

void add_shaded(const CameraRays& rays, std::span<const Hit> hits, Band band, const SurfaceSamples& surface,
                Vec3f up, float weight, Image& picture, Image* by_key) {
  const std::size_t width = rays.width, height = rays.height;
  RBVH_CHECK(hits.size() == width * height && surface.normals.size() == band.rows * width);
  const Lights lights{to_key_light(rays), up};
  const float pixel_angle = length(array3(rays.up));
  int radii[std::size(kPixelsAtWhichReliefIsSought)];
  for (std::size_t i = 0; i < std::size(radii); ++i)
    radii[i] = std::max(1, static_cast<int>(std::lround(kPixelsAtWhichReliefIsSought[i] *
                                                        static_cast<float>(height) / 1024)));

  const auto around = static_cast<std::size_t>(*std::max_element(std::begin(radii), std::end(radii)));
  const std::size_t above = std::min(band.first, around), first_row = band.first - above;
  const std::size_t last_row = std::min(height, band.first + band.rows + around);
  std::vector<float> halves((last_row - first_row) * width);
  parallel_for(halves.size(), kRows * width, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Hit& hit = hits[first_row * width + i];
      halves[i] = is_hit(hit) ? 0.5f / hit.t : 0;
    }
  });
  parallel_for(band.rows, kRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = band.first + begin; y < band.first + end; ++y)
      for (std::size_t x = 0; x < width; ++x) {
        const Hit& hit = hits[y * width + x];
        if (!is_hit(hit)) continue;
        const std::size_t i = (y - band.first) * width + x;
        const Vec3f view =
            -pixel_direction(rays, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
        const bool from_behind = dot(array3(hit.normal), view) < 0;
        Vec3f normal = from_behind ? -surface.normals[i] : surface.normals[i];
        // A smooth normal may turn away at the silhouette, where the surface itself does not.
        const float facing = dot(normal, view);
        if (facing < 0) normal = normalized(normal - view * facing);
        Vec3f albedo = surface.colors.empty() ? kClay : surface.colors[i];
        if (from_behind) albedo = times(albedo, kBackTint);

        float bend = 0;
        for (const int radius : radii)
          bend += relief(halves, first_row, hit.t, width, height, x, y, radius, pixel_angle);
        bend = std::clamp(bend, -1.f, 1.f);
        const float cavity = bend > 0 ? 1 - kValley * bend : 1 - kRidge * bend;
        const Lit lit = light(albedo, normal, view, lights);
        float* out = picture.at(x, y);
        out[3] += weight;
        for (int c = 0; c < 3; ++c) {
          if (by_key == nullptr) {
            out[c] += std::clamp((lit.key[c] + lit.rest[c]) * cavity, 0.f, 1.f) * weight;
          } else {
            out[c] += lit.rest[c] * cavity * weight;
            by_key->at(x, y)[c] += lit.key[c] * cavity * weight;
          }
        }
      }
  });
}

Image shade(const CameraRays& rays, std::span<const Hit> hits, const SurfaceSamples& surface, Vec3f up) {
  Image picture = make_image(Image::Kind::kColor, rays.width, rays.height, {"R", "G", "B", "A"});
  add_shaded(rays, hits, {0, rays.height}, surface, up, 1, picture);
  return picture;
}

Image data_image(Aov aov, const CameraRays& rays, std::span<const Hit> hits) {
  const std::size_t width = rays.width;
  RBVH_CHECK(hits.size() == width * rays.height);
  std::vector<std::string> channels;
  if (aov == Aov::kNormal) channels = {"N.X", "N.Y", "N.Z"};
  if (aov == Aov::kDepth) channels = {"Z"};
  if (aov == Aov::kPosition) channels = {"P.X", "P.Y", "P.Z"};
  if (aov == Aov::kLeaf) channels = {"leaf"};
  RBVH_CHECK(!channels.empty());
  Image image = make_image(Image::Kind::kData, rays.width, rays.height, std::move(channels));
  constexpr float kNowhere = std::numeric_limits<float>::infinity();
  parallel_for(rays.height, kRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y)
      for (std::size_t x = 0; x < width; ++x) {
        const Hit& hit = hits[y * width + x];
        const bool found = is_hit(hit);
        float* out = image.at(x, y);
        if (aov == Aov::kNormal) put(out, found ? array3(hit.normal) : Vec3f{});
        if (aov == Aov::kDepth) *out = found ? hit.t : kNowhere;
        if (aov == Aov::kLeaf) *out = found ? static_cast<float>(hit.leaf) : -1;
        if (aov == Aov::kPosition) {
          const Ray ray = pixel_ray(rays, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
          put(out, found ? array3(ray.origin) + array3(ray.direction) * hit.t
                         : Vec3f{kNowhere, kNowhere, kNowhere});
        }
      }
  });
  return image;
}

Image steps_image(const CameraRays& rays, std::span<const std::uint32_t> steps) {
  Image image = make_image(Image::Kind::kData, rays.width, rays.height, {"steps"});
  RBVH_CHECK(steps.size() == image.pixels.size());
  std::transform(steps.begin(), steps.end(), image.pixels.begin(),
                 [](std::uint32_t s) { return static_cast<float>(s); });
  return image;
}

Image shown_image(Aov aov, const Image& data) {
  if (aov == Aov::kDepth || aov == Aov::kPosition)
    throw Error(ErrorKind::kUsage, "", "depth and position are written as .exr only");
  Image image = make_image(Image::Kind::kShown, data.width, data.height, {"R", "G", "B", "A"});
  const std::size_t pixels = std::size_t{data.width} * data.height;
  float most = 1;
  if (aov == Aov::kSteps && pixels > 0) {
    std::vector<float> sorted = data.pixels;
    const auto nth = sorted.begin() + static_cast<std::ptrdiff_t>((pixels - 1) * 999 / 1000);
    std::nth_element(sorted.begin(), nth, sorted.end());
    most = std::max(1.f, *nth);
  }
  for (std::size_t i = 0; i < pixels; ++i) {
    const float* in = &data.pixels[i * data.channels.size()];
    float* out = &image.pixels[i * 4];
    bool found = true;
    if (aov == Aov::kNormal) {
      found = in[0] != 0 || in[1] != 0 || in[2] != 0;
      if (found) put(out, {in[0] * 0.5f + 0.5f, in[1] * 0.5f + 0.5f, in[2] * 0.5f + 0.5f});
    } else if (aov == Aov::kLeaf) {
      found = in[0] >= 0;
      if (found) put(out, distinct_color(static_cast<std::uint32_t>(in[0])));
    } else {
      put(out, ramp(in[0] / most));
    }
    out[3] = found ? 1.f : 0.f;
  }
  return image;
}

}  // namespace rbvh
