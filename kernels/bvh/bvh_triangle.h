// Triangles that are tested one by one: the leaves of the binary and the kd-tree traversals.
#ifndef RBVH_BVH_TRIANGLE_H
#define RBVH_BVH_TRIANGLE_H
#include "kernels/bvh/triangle.h"

// True where the triangle takes the place of what was found.
static inline bool intersect_triangle(__global const BvhTriangle* triangles, uint at, const PreparedRay* q,
                                      Found* found) {
  __global const BvhTriangle* p = triangles + at;
  const float ox = q->origin[q->kx], oy = q->origin[q->ky], oz = q->origin[q->kz];
  const float a[3] = {p->a[q->kx] - ox, p->a[q->ky] - oy, p->a[q->kz] - oz};
  const float b[3] = {p->b[q->kx] - ox, p->b[q->ky] - oy, p->b[q->kz] - oz};
  const float c[3] = {p->c[q->kx] - ox, p->c[q->ky] - oy, p->c[q->kz] - oz};
  float t, v, w, area;
  if (!intersect_corners(a, b, c, q->sx, q->sy, q->sz, &t, &v, &w, &area)) return false;
  if (!(t >= q->tmin && t <= found->t) || !is_nearer(t, p->id, found)) return false;
  *found = (Found){t, v / area, w / area, p->id, at};
  return true;
}

// A BVH's leaf: triangles from `at` to the next one marked as the last. True where one was taken.
static inline bool intersect_triangles(__global const BvhTriangle* triangles, uint at, const PreparedRay* q,
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
