#include "tests/bench/bench_rays.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "pipeline/base/error.h"
#include "pipeline/trace/camera_rays.h"
#include "rbvh/camera.h"

namespace rbvh::bench {
namespace {

Ray make_ray(const Vec3f& origin, const Vec3f& direction) {
  return {{origin.x, origin.y, origin.z},
          0,
          {direction.x, direction.y, direction.z},
          std::numeric_limits<float>::infinity()};
}

/// In [0, 1), the same on every platform.
float uniform(std::mt19937& random) { return static_cast<float>(random() >> 8) * 0x1p-24f; }

}  // namespace

std::vector<Ray> primary_rays(const CameraRays& camera) {
  RBVH_CHECK(camera.width % 8 == 0 && camera.height % 8 == 0);
  std::vector<Ray> rays;
  rays.reserve(std::size_t{camera.width} * camera.height);
  const Vec3f origin = {camera.position[0], camera.position[1], camera.position[2]};
  for (std::uint32_t square_y = 0; square_y < camera.height; square_y += 8) {
    for (std::uint32_t square_x = 0; square_x < camera.width; square_x += 8) {
      for (std::uint32_t i = 0; i < 64; ++i) {
        const std::uint32_t x = square_x + i / 16 % 2 * 4 + i % 4, y = square_y + i / 32 * 4 + i % 16 / 4;
        rays.push_back(make_ray(origin, pixel_direction(camera, x, y)));
      }
    }
  }
  return rays;
}

std::vector<Ray> diffuse_rays(const std::vector<Ray>& rays, const std::vector<Hit>& hits, float offset,
                              std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<Ray> bounced;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (hits[i].leaf == RBVH_NO_LEAF) continue;
    const Vec3f origin = {rays[i].origin[0], rays[i].origin[1], rays[i].origin[2]};
    const Vec3f direction = {rays[i].direction[0], rays[i].direction[1], rays[i].direction[2]};
    Vec3f normal = {hits[i].normal[0], hits[i].normal[1], hits[i].normal[2]};
    if (dot(normal, direction) > 0) normal = -normal;
    // The normal plus a point on the unit sphere is cosine-distributed.
    const float z = 2 * uniform(random) - 1, angle = 2 * std::numbers::pi_v<float> * uniform(random);
    const float r = std::sqrt(std::max(0.0f, 1 - z * z));
    const Vec3f sum = normal + Vec3f{r * std::cos(angle), r * std::sin(angle), z};
    const Vec3f bounce = dot(sum, sum) > 1e-6f ? normalized(sum) : normal;
    bounced.push_back(make_ray(origin + direction * hits[i].t + normal * offset, bounce));
  }
  return bounced;
}

}  // namespace rbvh::bench
