// A camera's rays on the host, as the kernels compute them (kernels/common/camera_rays.h).
#pragma once

#include <limits>

#include "kernels/common/layout.h"
#include "pipeline/base/vec.h"

namespace rbvh {

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
