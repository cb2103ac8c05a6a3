// A camera's rays on the host, as the kernels compute them (kernels/common/camera_rays.h), and their hits.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/device/device.h"
#include "rbvh/geometry.h"
#include "rbvh/tracer.h"

namespace rbvh {

/// A picture's hits, row by row. One after the other can be kept in it: memory that is new to the process
/// costs as much as casting.
struct CameraHits {
  std::vector<Hit> hits;
  std::vector<std::uint32_t> steps;  ///< as many, where they are counted
  Buffer<Hit> on_device;             ///< of a band of rows
};

/// Casts a camera's rays in bands that fit the device.
void intersect(const Tracer& tracer, const CameraRays& camera, bool count_steps, CameraHits& out);

/// How far apart a picture's samples are at distance 1: what Tracer::surface() averages over.
inline float sample_spread(const CameraRays& rays, int samples) {
  return std::hypot(rays.up[0], rays.up[1], rays.up[2]) / std::sqrt(static_cast<float>(std::max(1, samples)));
}

/// The unit direction of one pixel's ray.
inline Vec3f pixel_direction(const CameraRays& rays, std::uint32_t x, std::uint32_t y) {
  const float px = static_cast<float>(x) + rays.offset_x, py = static_cast<float>(y) + rays.offset_y;
  Vec3f d;
  for (int axis = 0; axis < 3; ++axis)
    d[axis] = rays.corner[axis] + rays.right[axis] * px + rays.up[axis] * py;
  return normalized(d);
}

inline Ray pixel_ray(const CameraRays& rays, std::uint32_t x, std::uint32_t y) {
  const Vec3f d = pixel_direction(rays, x, y);
  return {{rays.position[0], rays.position[1], rays.position[2]},
          0,
          {d.x, d.y, d.z},
          std::numeric_limits<float>::max()};
}

}  // namespace rbvh
