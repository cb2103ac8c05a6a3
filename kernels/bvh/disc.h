// The disc test.
#ifndef RBVH_DISC_H
#define RBVH_DISC_H
#include "kernels/bvh/prepared_ray.h"
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

DEFINE_INTERSECT_DISC(intersect_discs16, float16, float, float16, int16)      // 1 ray, 16 discs
DEFINE_INTERSECT_DISC(intersect_disc_packet, float, float16, float16, int16)  // 16 rays, 1 disc

// Defines  void NAME(centre, normal, radius, d, t, u, v): where a ray's point at t is on the disc: -1 to 1,
// along two unit vectors across its unit normal (Duff et al., "Building an Orthonormal Basis, Revisited",
// JCGT 2017). centre: seen from the origin.
#define DEFINE_DISC_PLACE(NAME, F)                                                                          \
  static ALWAYS_INLINE void NAME(const F* c, const F* n, F radius, const F* d, F t, F* u, F* v) {           \
    const F sign = copysign((F)(1.0f), n[2]), a = -1.0f / (sign + n[2]), b = n[0] * n[1] * a;               \
    const F x = (t * d[0] - c[0]) / radius, y = (t * d[1] - c[1]) / radius, z = (t * d[2] - c[2]) / radius; \
    *u = x * (1.0f + sign * n[0] * n[0] * a) + y * (sign * b) - z * (sign * n[0]);                          \
    *v = x * b + y * (sign + n[1] * n[1] * a) - z * n[1];                                                   \
  }

DEFINE_DISC_PLACE(disc_place, float)
DEFINE_DISC_PLACE(disc_place16, float16)
#endif
