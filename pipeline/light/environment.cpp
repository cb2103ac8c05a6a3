#include "pipeline/light/environment.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pipeline/base/error.h"
#include "pipeline/base/vector_math.h"

namespace rbvh {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kLeastSine = 1e-6f;  // at the poles, where pixels end in a point

Vec3f pixel(const Image& sky, std::size_t x, std::size_t y) {
  const float* p = sky.at(x, y);
  return {p[0], p[1], p[2]};
}

// Where a direction falls on the sky, in pixels.
struct SkyPoint {
  float x, y, sin_theta;
};

SkyPoint sky_point(const EnvironmentSampler& s, Vec3f d) {
  const Image& sky = s.environment.sky;
  const float x = dot(d, s.x), y = dot(d, s.y), sin_theta = std::sqrt(x * x + y * y);
  float turn = std::atan2(y, x) / (2 * kPi);
  if (turn < 0) turn += 1;
  return {turn * static_cast<float>(sky.width),
          std::atan2(sin_theta, dot(d, s.environment.up)) / kPi * static_cast<float>(sky.height),
          std::max(sin_theta, kLeastSine)};
}

// Bilinear: around the circle, and up to the poles.
Vec3f sky_radiance(const EnvironmentSampler& s, Vec3f d) {
  const Image& sky = s.environment.sky;
  if (sky.pixels.empty()) return {};
  if (sky.pixels.size() == 3) return pixel(sky, 0, 0);
  const SkyPoint at = sky_point(s, d);
  const float px = at.x - 0.5f, py = std::clamp(at.y - 0.5f, 0.f, static_cast<float>(sky.height - 1));
  const float fx = std::floor(px), fy = std::floor(py);
  const std::size_t x0 = (static_cast<std::size_t>(fx + static_cast<float>(sky.width))) % sky.width;
  const std::size_t y0 = static_cast<std::size_t>(fy);
  const std::size_t x1 = (x0 + 1) % sky.width, y1 = std::min<std::size_t>(y0 + 1, sky.height - 1);
  const float a = px - fx, b = py - fy;
  return (pixel(sky, x0, y0) * (1 - a) + pixel(sky, x1, y0) * a) * (1 - b) +
         (pixel(sky, x0, y1) * (1 - a) + pixel(sky, x1, y1) * a) * b;
}

bool in_sun(const Sun& sun, Vec3f d) { return dot(d, sun.direction) >= std::cos(sun.angle); }

// 1 - cos, without cancellation.
float sun_height(const Sun& sun) {
  const float s = std::sin(sun.angle / 2);
  return 2 * s * s;
}

// The pixel whose part of the sums, which end in their total, `u` falls into; `u` becomes where in it.
std::size_t choose(std::span<const float> sums, float& u) {
  const float at = u * sums.back();
  const std::size_t i =
      std::min(static_cast<std::size_t>(std::upper_bound(sums.begin(), sums.end(), at) - sums.begin()),
               sums.size() - 1);
  const float before = i > 0 ? sums[i - 1] : 0, width = sums[i] - before;
  u = width > 0 ? std::clamp((at - before) / width, 0.f, 0x1.fffffep-1f) : 0.5f;
  return i;
}

}  // namespace

EnvironmentSampler make_sampler(const Environment& environment) {
  EnvironmentSampler s;
  s.environment = environment;
  const Image& sky = environment.sky;
  RBVH_CHECK(sky.pixels.size() == std::size_t{3} * sky.width * sky.height);
  s.x = static_cast<Vec3f>(front_of(static_cast<Vec3d>(environment.up)));
  s.y = cross(environment.up, s.x);

  double sky_power = 0;  // radiance over the sphere
  const std::size_t width = sky.width, height = sky.height;
  s.pixel_sums.resize(width * height);
  s.row_sums.resize(height);
  double all = 0;
  for (std::size_t y = 0; y < height; ++y) {
    const double sin_theta =
        std::sin(std::numbers::pi * (static_cast<double>(y) + 0.5) / static_cast<double>(height));
    double row = 0;
    for (std::size_t x = 0; x < width; ++x) {
      // As bright as anything that interpolation brings into the pixel, so that no light is missed.
      float weight = 0;
      for (std::size_t j = y > 0 ? y - 1 : 0; j <= std::min(y + 1, height - 1); ++j)
        for (const std::size_t i : {(x + width - 1) % width, x, (x + 1) % width})
          weight += luminance(pixel(sky, i, j)) * (i == x && j == y ? 8.f : 1.f) / 16;
      row += static_cast<double>(weight) * sin_theta;
      s.pixel_sums[y * width + x] = static_cast<float>(row);
      sky_power += static_cast<double>(luminance(pixel(sky, x, y))) * sin_theta;
    }
    all += row;
    s.row_sums[y] = static_cast<float>(all);
  }
  if (width > 0) sky_power *= 2 * std::numbers::pi * std::numbers::pi / static_cast<double>(width * height);
  const double sun_power = static_cast<double>(luminance(environment.sun.radiance)) * 2 * std::numbers::pi *
                           static_cast<double>(sun_height(environment.sun));
  s.is_black = !(sky_power + sun_power > 0);
  s.is_uniform = sky.pixels.size() == 3 && !(sun_power > 0);
  // Half each where both shine: the sun makes the sharp shadows, whatever its power.
  s.sun_share = sun_power > 0 ? (sky_power > 0 ? 0.5f : 1.f) : 0.f;
  return s;
}

Vec3f radiance(const EnvironmentSampler& s, Vec3f direction) {
  const Sun& sun = s.environment.sun;
  const Vec3f sky = sky_radiance(s, direction);
  return s.sun_share > 0 && in_sun(sun, direction) ? sky + sun.radiance : sky;
}

float pdf(const EnvironmentSampler& s, Vec3f direction) {
  float density = 0;
  if (s.sun_share > 0 && in_sun(s.environment.sun, direction))
    density += s.sun_share / (2 * kPi * sun_height(s.environment.sun));
  if (s.sun_share < 1 && !s.row_sums.empty() && s.row_sums.back() > 0) {
    const Image& sky = s.environment.sky;
    const SkyPoint at = sky_point(s, direction);
    const std::size_t x = std::min(static_cast<std::size_t>(at.x), std::size_t{sky.width} - 1);
    const std::size_t y = std::min(static_cast<std::size_t>(at.y), std::size_t{sky.height} - 1);
    const std::size_t i = y * sky.width + x;
    const float weight = s.pixel_sums[i] - (x > 0 ? s.pixel_sums[i - 1] : 0);
    // Even over the pixel, which is narrower towards the poles.
    density += (1 - s.sun_share) * weight / s.row_sums.back() *
               static_cast<float>(std::size_t{sky.width} * sky.height) / (2 * kPi * kPi * at.sin_theta);
  }
  return density;
}

LightSample sample_light(const EnvironmentSampler& s, float choice, float u, float v) {
  if (s.is_black) return {};
  LightSample sample;
  const Sun& sun = s.environment.sun;
  if (choice < s.sun_share) {
    const float down = u * sun_height(sun), sin_theta = std::sqrt(down * (2 - down)), phi = 2 * kPi * v;
    Vec3f x, y;
    make_frame(sun.direction, x, y);
    sample.direction = normalized(x * (sin_theta * std::cos(phi)) + y * (sin_theta * std::sin(phi)) +
                                  sun.direction * (1 - down));
    if (!in_sun(sun, sample.direction)) sample.direction = sun.direction;  // rounded off its edge
  } else {
    const Image& sky = s.environment.sky;
    const std::size_t row = choose(s.row_sums, v);
    const std::size_t column = choose(std::span(s.pixel_sums).subspan(row * sky.width, sky.width), u);
    const float theta = kPi * (static_cast<float>(row) + v) / static_cast<float>(sky.height);
    const float phi = 2 * kPi * (static_cast<float>(column) + u) / static_cast<float>(sky.width);
    sample.direction = normalized((s.x * std::cos(phi) + s.y * std::sin(phi)) * std::sin(theta) +
                                  s.environment.up * std::cos(theta));
  }
  sample.radiance = radiance(s, sample.direction);
  sample.pdf = pdf(s, sample.direction);
  return sample;
}

}  // namespace rbvh
