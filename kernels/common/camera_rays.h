// The ray through a pixel of CameraRays, and an order of pixels in which neighbours in time are neighbours in
// space.
#ifndef RBVH_CAMERA_RAYS_H
#define RBVH_CAMERA_RAYS_H
#include "kernels/common/layout.h"

static inline Ray camera_ray(const CameraRays* camera, uint x, uint y) {
  const float sx = (float)x + camera->offset_x, sy = (float)y + camera->offset_y;
  float d[3];
  for (int i = 0; i < 3; ++i) d[i] = camera->corner[i] + camera->right[i] * sx + camera->up[i] * sy;
  const float scale = 1.0f / sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  Ray ray;
  for (int i = 0; i < 3; ++i) {
    ray.origin[i] = camera->position[i];
    ray.direction[i] = d[i] * scale;
  }
  ray.tmin = 0.0f;
  ray.tmax = INFINITY;
  return ray;
}

// The i-th pixel when squares of 8 x 8 pixels are visited row by row; it may lie beyond the image's right or
// lower edge.
static inline uint2 camera_pixel(uint width, uint i) {
  const uint squares = (width + 7) / 8, square = i / 64, in = i % 64;
  return (uint2)(square % squares * 8 + in % 8, square / squares * 8 + in / 8);
}
#endif
