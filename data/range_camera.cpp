#include "range_camera.h"

#include <numbers>

#include "pipeline/base/parallel_for.h"

namespace rbvh::demo {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

/// splitmix64's finaliser.
std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

/// Standard normal, by Box and Muller.
float random_normal(std::uint64_t seed, std::uint64_t a, std::uint64_t b) {
  const float u = 1 - random_unit(seed, a, 2 * b), v = random_unit(seed, a, 2 * b + 1);
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
}

/// Distance to the shape along a unit ray, or 0. Steps are kept short of the distance, which folds overstate
/// a little.
float cast(const DemoShape& shape, Vec3f eye, Vec3f direction, float precision) {
  float near = 0, far = 1e30f;
  for (int axis = 0; axis < 3; ++axis) {
    const float scale = 1 / (direction[axis] == 0 ? 1e-20f : direction[axis]);
    const float a = (shape.bounds().lo[axis] - eye[axis]) * scale,
                b = (shape.bounds().hi[axis] - eye[axis]) * scale;
    near = std::max(near, std::min(a, b));
    far = std::min(far, std::max(a, b));
  }
  float t = near;
  for (int step = 0; step < 400 && t < far; ++step) {
    const float d = shape.distance(eye + direction * t);
    if (d < precision) return t + d;
    t += 0.75f * d;
  }
  return 0;
}

}  // namespace

float random_unit(std::uint64_t seed, std::uint64_t a, std::uint64_t b) {
  return static_cast<float>(mix(mix(mix(seed) ^ a) ^ b) >> 40) * 0x1p-24f;
}

std::vector<Vec3f> tripod_places(const DemoShape& shape) {
  const Vec3f center = shape.bounds().center();
  const float away = 1.9f * shape.bounds().diagonal();
  std::vector<Vec3f> places;
  const auto ring = [&](int count, float elevation_degrees, float turn_degrees) {
    for (int i = 0; i < count; ++i) {
      const float azimuth =
          2 * kPi * static_cast<float>(i) / static_cast<float>(count) + turn_degrees * kPi / 180;
      const float elevation = elevation_degrees * kPi / 180;
      places.push_back(center + Vec3f{std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                                      std::cos(azimuth) * std::cos(elevation)} *
                                    away);
    }
  };
  ring(9, 10, 10);
  ring(8, 35, 30);
  ring(5, 62, 5);
  ring(8, -12, 0);
  return places;
}

RangeImage take_range_image(const DemoShape& shape, Vec3f eye, std::uint64_t view,
                            const RangeCameraConfig& config) {
  const Vec3f center = shape.bounds().center();
  const float radius = 0.5f * shape.bounds().diagonal(), distance = length(center - eye);
  const float half_tangent = radius / std::sqrt(distance * distance - radius * radius);
  RangeImage image;
  image.eye = eye;
  image.width = config.width;
  image.forward = normalized(center - eye);
  const float pixel = 2 * half_tangent / static_cast<float>(config.width - 1);
  const Vec3f right = normalized(cross(image.forward, Vec3f{0, 1, 0}));
  image.right = right * pixel;
  image.up = cross(right, image.forward) * pixel;
  const auto width = static_cast<std::size_t>(config.width);
  image.ranges.assign(width * width, 0.0f);
  image.cosines.assign(width * width, 0.0f);

  const std::uint64_t seed = config.seed * 1000003u + view;
  // The whole view is a little out of place, as after registration; told to nobody.
  const Vec3f shift =
      Vec3f{random_normal(seed, ~0ull, 0), random_normal(seed, ~0ull, 1), random_normal(seed, ~0ull, 2)} *
      config.registration;
  const float precision = 0.02f * pixel * distance;
  parallel_for(width, 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) {
      for (std::size_t x = 0; x < width; ++x) {
        const std::size_t index = y * width + x;
        const Vec3f direction = image.direction(static_cast<float>(x), static_cast<float>(y));
        const float t = cast(shape, eye + shift, direction, precision);
        if (t == 0) continue;
        const Vec3f normal = shape.normal(eye + shift + direction * t, 4 * precision);
        const float cosine = std::max(0.0f, -dot(normal, direction));
        const float kept = (cosine - config.grazing_cosine / 3) / (config.grazing_cosine * 2 / 3);
        if (random_unit(seed, index, 100) >= kept) continue;
        const bool wild = random_unit(seed, index, 101) < config.outlier_share;
        const float error = wild ? 0.2f * radius * (random_unit(seed, index, 102) - 0.5f)
                                 : config.noise * random_normal(seed, index, 0) / std::max(cosine, 0.3f);
        image.ranges[index] = t + error;
        image.cosines[index] = cosine;
      }
    }
  });
  return image;
}

}  // namespace rbvh::demo
