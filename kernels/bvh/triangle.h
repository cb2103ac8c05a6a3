// One triangle met by one ray (exact_query.h says how), and the leaves of the traversals that meet them one
// by one.
#ifndef RBVH_EXACT_TRIANGLE_H
#define RBVH_EXACT_TRIANGLE_H
#include "kernels/bvh/ray_query.h"

// True where the triangle takes the place of what was found. U, V, W: twice the signed areas of the
// triangle's parts opposite a, b and c, seen along the ray.
static inline bool intersect_triangle(__global const BvhTriangle* triangles, uint at, const Query* q,
                                      Found* found) {
  __global const BvhTriangle* p = triangles + at;
  const float ox = q->origin[q->kx], oy = q->origin[q->ky], oz = q->origin[q->kz];
  const float az = p->a[q->kz] - oz, bz = p->b[q->kz] - oz, cz = p->c[q->kz] - oz;
  const float ax = (p->a[q->kx] - ox) - q->sx * az, ay = (p->a[q->ky] - oy) - q->sy * az;
  const float bx = (p->b[q->kx] - ox) - q->sx * bz, by = (p->b[q->ky] - oy) - q->sy * bz;
  const float cx = (p->c[q->kx] - ox) - q->sx * cz, cy = (p->c[q->ky] - oy) - q->sy * cz;
  float u = cx * by - cy * bx;
  float v = ax * cy - ay * cx;
  float w = bx * ay - by * ax;
#ifdef cl_khr_fp64
  if (u == 0.0f || v == 0.0f || w == 0.0f) {
    // Products of floats are exact in double: now a zero is a zero.
    u = (float)((double)cx * (double)by - (double)cy * (double)bx);
    v = (float)((double)ax * (double)cy - (double)ay * (double)cx);
    w = (float)((double)bx * (double)ay - (double)by * (double)ax);
  }
#endif
  if ((u < 0.0f || v < 0.0f || w < 0.0f) && (u > 0.0f || v > 0.0f || w > 0.0f)) return false;
  const float area = u + v + w;
  if (area == 0.0f) return false;
  const float t = (u * (q->sz * az) + v * (q->sz * bz) + w * (q->sz * cz)) / area;
  if (!(t >= q->tmin && t <= found->t) || !is_nearer(t, p->id, found)) return false;
  *found = (Found){t, v / area, w / area, p->id, at};
  return true;
}

// A BVH's leaf: triangles from `at` to the next one marked as the last. True where one was taken.
static inline bool intersect_triangles(__global const BvhTriangle* triangles, uint at, const Query* q,
                                       uint any, Found* found, uint2* visited) {
  bool taken = false;
  for (bool last = false; !last; ++at) {
    ++visited->y;
    last = triangles[at].is_last != 0;
    if (intersect_triangle(triangles, at, q, found)) {
      taken = true;
      if (any) break;
    }
  }
  return taken;
}

static inline float3 unit_normal(__global const BvhTriangle* triangles, uint at) {
  __global const BvhTriangle* p = triangles + at;
  return triangle_normal((float3)(p->a[0], p->a[1], p->a[2]), (float3)(p->b[0], p->b[1], p->b[2]),
                         (float3)(p->c[0], p->c[1], p->c[2]));
}
#endif
