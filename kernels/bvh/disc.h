// The disc test.
#ifndef RBVH_DISC_H
#define RBVH_DISC_H
#include "kernels/bvh/ray_query.h"
#include "kernels/common/lanes.h"

#pragma OPENCL FP_CONTRACT OFF

// Defines  I NAME(centre, normal, radius, d, t): the lanes in which a line along d hits the disc, at t.
// centre: seen from the origin. P: a disc's type, D: a ray's, F: the wider of the two, I: F's comparison.
#define DEFINE_INTERSECT_DISC(NAME, P, D, F, I)                                     \
  static ALWAYS_INLINE I NAME(const P* c, const P* n, P radius, const D* d, F* t) { \
    const F slope = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];                        \
    *t = (c[0] * n[0] + c[1] * n[1] + c[2] * n[2]) / slope;                         \
    const F x = *t * d[0] - c[0], y = *t * d[1] - c[1], z = *t * d[2] - c[2];       \
    return (slope != 0.0f) & (x * x + y * y + z * z <= radius * radius);            \
  }

DEFINE_INTERSECT_DISC(intersect_discs8, float8, float, float8, int8)          // 1 ray, 8 discs
DEFINE_INTERSECT_DISC(intersect_discs16, float16, float, float16, int16)      // 1 ray, 16 discs
DEFINE_INTERSECT_DISC(intersect_disc_packet, float, float16, float16, int16)  // 16 rays, 1 disc

// Two unit vectors across a unit normal (Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017).
static inline void disc_frame(float3 n, float3* x, float3* y) {
  const float sign = copysign(1.0f, n.z), a = -1.0f / (sign + n.z), b = n.x * n.y * a;
  *x = (float3)(1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x);
  *y = (float3)(b, sign + n.y * n.y * a, -n.y);
}

// Of a ray's point at t, across the disc: -1 to 1.
static inline float2 disc_place(float3 centre, float3 normal, float radius, float3 origin, float3 direction,
                                float t) {
  const float3 r = (t * direction - (centre - origin)) / radius;
  float3 x, y;
  disc_frame(normal, &x, &y);
  return (float2)(dot(r, x), dot(r, y));
}
#endif
