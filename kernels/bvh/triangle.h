// The triangle test: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2013. Every vertex is
// moved into the ray's own space by arithmetic that depends on nothing but the vertex and the ray, so two
// triangles that share an edge see the same edge; a sign that float cannot tell is found in double.
#ifndef RBVH_TRIANGLE_H
#define RBVH_TRIANGLE_H
#include "kernels/bvh/prepared_ray.h"
#include "kernels/common/lanes.h"

// A fused product would differ from the one that the neighbouring triangle has.
#pragma OPENCL FP_CONTRACT OFF

#ifdef cl_khr_fp64
// Products of floats are exact in double: now a zero is a zero. Only in lanes where there was one, or hits
// would depend on who else is tested.
#define RESOLVE_ZEROS(F, N, unsure)                                                                      \
  const double##N dax = convert_double##N(ax), day = convert_double##N(ay), dbx = convert_double##N(bx), \
                  dby = convert_double##N(by), dcx = convert_double##N(cx), dcy = convert_double##N(cy); \
  u = select(u, convert_float##N(dcx * dby - dcy * dbx), unsure);                                        \
  v = select(v, convert_float##N(dax * dcy - day * dcx), unsure);                                        \
  w = select(w, convert_float##N(dbx * day - dby * dax), unsure);
#else
#define RESOLVE_ZEROS(F, N, unsure)
#endif

// The areas of a triangle's parts, seen along the ray: twice those opposite a, b and c, signed, and the sum.
#define DEFINE_TRIANGLE_AREAS(NAME, F, I, N, LANES)                                                   \
  typedef struct NAME {                                                                               \
    F u, v, w, sum;                                                                                   \
  } NAME;                                                                                             \
  /* Of sheared corners; returns the lanes in which the line passes through the triangle, as bits. */ \
  static ALWAYS_INLINE uint triangle_areas##LANES(F ax, F ay, F bx, F by, F cx, F cy, NAME* areas) {  \
    F u = cx * by - cy * bx, v = ax * cy - ay * cx, w = bx * ay - by * ax;                            \
    const I su = as_##I(u), sv = as_##I(v), sw = as_##I(w);                                           \
    uint inside = lane_bits##LANES((~(su | sv | sw) | (su & sv & sw)) >> 31); /* their signs agree */ \
    const I unsure = (u == 0.0f) | (v == 0.0f) | (w == 0.0f);                                         \
    const uint unsure_bits = lane_bits##LANES(unsure);                                                \
    if (unsure_bits) {                                                                                \
      RESOLVE_ZEROS(F, N, unsure)                                                                     \
      const I resolved =                                                                              \
          (((u >= 0.0f) & (v >= 0.0f) & (w >= 0.0f)) | ((u <= 0.0f) & (v <= 0.0f) & (w <= 0.0f))) &   \
          (u + v + w != 0.0f);                                                                        \
      inside = (inside & ~unsure_bits) | (lane_bits##LANES(resolved) & unsure_bits);                  \
    }                                                                                                 \
    *areas = (NAME){u, v, w, u + v + w};                                                              \
    return inside;                                                                                    \
  }

DEFINE_TRIANGLE_AREAS(Areas1, float, int, , 1)
DEFINE_TRIANGLE_AREAS(Areas16, float16, int16, 16, 16)

// Defines  uint NAME(a, b, c, sx, sy, sz, t, v, w, area): the lanes in which the line hits the triangle, as
// bits, at t, with v / area and w / area as the weights of b and c. a, b, c: the corners seen from the
// origin, along kx, ky, kz. P: a corner's type, D: a ray's, F: the wider of the two.
#define DEFINE_INTERSECT_TRIANGLE(NAME, P, D, F, LANES)                                                      \
  static ALWAYS_INLINE uint NAME(const P* a, const P* b, const P* c, D sx, D sy, D sz, F* t, F* v, F* w,     \
                                 F* area) {                                                                  \
    Areas##LANES areas;                                                                                      \
    const uint inside = triangle_areas##LANES(a[0] - sx * a[2], a[1] - sy * a[2], b[0] - sx * b[2],          \
                                              b[1] - sy * b[2], c[0] - sx * c[2], c[1] - sy * c[2], &areas); \
    if (inside == 0) return 0;                                                                               \
    *t = (areas.u * (sz * a[2]) + areas.v * (sz * b[2]) + areas.w * (sz * c[2])) / areas.sum;                \
    *v = areas.v;                                                                                            \
    *w = areas.w;                                                                                            \
    *area = areas.sum;                                                                                       \
    return inside;                                                                                           \
  }

DEFINE_INTERSECT_TRIANGLE(intersect_corners, float, float, float, 1)              // 1 ray, 1 triangle
DEFINE_INTERSECT_TRIANGLE(intersect_corners_packet, float, float16, float16, 16)  // 16 rays, 1 triangle

// normalize() of 16 vectors. Scaled first, as it does: the squares of a sliver's normal would vanish.
static ALWAYS_INLINE void normalize16(float16* n) {
  const float16 largest = max(fabs(n[0]), max(fabs(n[1]), fabs(n[2])));
  const float16 inverse = select((float16)(0.0f), 1.0f / largest, largest > 0.0f);
  for (uint axis = 0; axis < 3; ++axis) n[axis] *= inverse;
  const float16 squares = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
  const float16 inverse_length = select((float16)(0.0f), 1.0f / sqrt(squares), squares > 0.0f);
  for (uint axis = 0; axis < 3; ++axis) n[axis] *= inverse_length;
}

// triangle_normal() of 16 triangles, a coordinate a vector.
static ALWAYS_INLINE void triangle_normals16(const float16* a, const float16* b, const float16* c,
                                             float16* n) {
  float16 ab[3], ac[3], e = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    ab[axis] = b[axis] - a[axis];
    ac[axis] = c[axis] - a[axis];
    e = max(e, max(fabs(ab[axis]), fabs(ac[axis])));
  }
  const float16 scale = 1.0f / e;
  for (uint axis = 0; axis < 3; ++axis) {
    ab[axis] *= scale;
    ac[axis] *= scale;
  }
  for (uint axis = 0; axis < 3; ++axis)
    n[axis] = ab[(axis + 1) % 3] * ac[(axis + 2) % 3] - ab[(axis + 2) % 3] * ac[(axis + 1) % 3];
  normalize16(n);
}
#endif
