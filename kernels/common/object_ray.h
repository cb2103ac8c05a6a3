// Rays and normals between the world and an object's space.
#ifndef RBVH_OBJECT_RAY_H
#define RBVH_OBJECT_RAY_H
#include "kernels/common/layout.h"

// So that a ray in the object's space does not depend on the kernel that places it.
#pragma OPENCL FP_CONTRACT OFF

// The ray in the object's space, with the same t. `to_object`: rows of an affine map.
static inline Ray object_ray(const float* to_object, const Ray* ray) {
  Ray r;
  for (uint row = 0; row < 3; ++row) {
    const float* m = to_object + 4 * row;
    r.origin[row] = m[0] * ray->origin[0] + m[1] * ray->origin[1] + m[2] * ray->origin[2] + m[3];
    r.direction[row] = m[0] * ray->direction[0] + m[1] * ray->direction[1] + m[2] * ray->direction[2];
  }
  r.tmin = ray->tmin;
  r.tmax = ray->tmax;
  return r;
}

// Normals transform by the transposed map. Unit; a normal without length becomes the reversed direction.
static inline float3 world_normal(const float* to_object, const float* normal, const float* direction) {
  const float* m = to_object;
  const float3 n = (float3)(m[0] * normal[0] + m[4] * normal[1] + m[8] * normal[2],
                            m[1] * normal[0] + m[5] * normal[1] + m[9] * normal[2],
                            m[2] * normal[0] + m[6] * normal[1] + m[10] * normal[2]);
  return dot(n, n) > 0.0f ? normalize(n) : -normalize((float3)(direction[0], direction[1], direction[2]));
}
#endif
