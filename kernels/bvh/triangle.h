// The triangle test: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2013. Every vertex is
// moved into the ray's own space by arithmetic that depends on nothing but the vertex and the ray, so two
// triangles that share an edge see the same edge; a sign that float cannot tell is found in double.
#ifndef RBVH_TRIANGLE_H
#define RBVH_TRIANGLE_H
#include "kernels/bvh/ray_query.h"
#include "kernels/common/lanes.h"

#ifdef cl_khr_fp64
// Products of floats are exact in double: now a zero is a zero. Only in lanes where there was one, or hits
// would depend on who else is tested.
#define RESOLVE_ZEROS(F, I, N, LANES)                                                                      \
  const I unsure = (u == 0.0f) | (v == 0.0f) | (w == 0.0f);                                                \
  if (lane_bits##LANES(unsure)) {                                                                          \
    const double##N dax = convert_double##N(ax), day = convert_double##N(ay), dbx = convert_double##N(bx), \
                    dby = convert_double##N(by), dcx = convert_double##N(cx), dcy = convert_double##N(cy); \
    u = select(u, convert_float##N(dcx * dby - dcy * dbx), unsure);                                        \
    v = select(v, convert_float##N(dax * dcy - day * dcx), unsure);                                        \
    w = select(w, convert_float##N(dbx * day - dby * dax), unsure);                                        \
  }
#else
#define RESOLVE_ZEROS(F, I, N, LANES)
#endif

// Defines  I NAME(a, b, c, sx, sy, sz, t, v, w, area): the lanes in which the line hits the triangle, at t,
// with v / area and w / area as the weights of b and c. a, b, c: the corners seen from the origin, along kx,
// ky, kz. u, v, w: twice the signed areas of the triangle's parts opposite a, b and c, seen along the ray. P:
// a corner's type, D: a ray's, F: the wider of the two; I, N, LANES: F's comparison, suffix and lanes.
#define DEFINE_INTERSECT_TRIANGLE(NAME, P, D, F, I, N, LANES)                                       \
  static ALWAYS_INLINE I NAME(const P* a, const P* b, const P* c, D sx, D sy, D sz, F* t, F* v_out, \
                              F* w_out, F* area_out) {                                              \
    const F ax = a[0] - sx * a[2], ay = a[1] - sy * a[2];                                           \
    const F bx = b[0] - sx * b[2], by = b[1] - sy * b[2];                                           \
    const F cx = c[0] - sx * c[2], cy = c[1] - sy * c[2];                                           \
    F u = cx * by - cy * bx, v = ax * cy - ay * cx, w = bx * ay - by * ax;                          \
    RESOLVE_ZEROS(F, I, N, LANES)                                                                   \
    const F area = u + v + w;                                                                       \
    const I inside =                                                                                \
        (((u >= 0.0f) & (v >= 0.0f) & (w >= 0.0f)) | ((u <= 0.0f) & (v <= 0.0f) & (w <= 0.0f))) &   \
        (area != 0.0f);                                                                             \
    if (lane_bits##LANES(inside) == 0) return inside;                                               \
    *t = (u * (sz * a[2]) + v * (sz * b[2]) + w * (sz * c[2])) / area;                              \
    *v_out = v;                                                                                     \
    *w_out = w;                                                                                     \
    *area_out = area;                                                                               \
    return inside;                                                                                  \
  }

DEFINE_INTERSECT_TRIANGLE(intersect_corners, float, float, float, int, , 1)       // 1 ray, 1 triangle
DEFINE_INTERSECT_TRIANGLE(intersect_corners8, float8, float, float8, int8, 8, 8)  // 1 ray, 8 triangles
DEFINE_INTERSECT_TRIANGLE(intersect_corners_packet, float, float16, float16, int16, 16,
                          16)  // 16 rays, 1 triangle
#endif
