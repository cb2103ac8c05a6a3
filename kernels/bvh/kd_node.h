// What the traversals of kd-trees share. Neighbouring cells share a plane, and a float cannot tell on which
// side of it a ray passes an edge that lies in it: a plane is crossed between an earliest and a latest t, and
// the cells on both sides are visited where the ray may be in them. A hit counts wherever it lies; the
// traversal ends where the cells to come begin behind it.
#ifndef RBVH_KD_NODE_H
#define RBVH_KD_NODE_H
#include "kernels/bvh/box.h"
#include "kernels/bvh/bvh_triangle.h"

// The part of the ray inside everything.
static inline float2 scene_interval(const BvhRoot* scene, const PreparedRay* q) {
  return box_interval((float3)(scene->lo[0], scene->lo[1], scene->lo[2]),
                      (float3)(scene->hi[0], scene->hi[1], scene->hi[2]), q);
}

// Where the ray crosses a plane: at the earliest and at the latest.
static inline float2 plane_crossing(float position, uint axis, const PreparedRay* q) {
  return (float2)(mad(position, q->inverse[axis], q->near_offset[axis]),
                  mad(position, q->inverse[axis], q->far_offset[axis]));
}

// 1 where the ray comes to the upper child first.
static inline uint near_side(uint axis, const PreparedRay* q) { return q->near_row[axis] > 2 ? 1 : 0; }

// A leaf: triangles by reference. True where one was taken.
static inline bool intersect_references(__global const BvhTriangle* triangles,
                                        __global const uint* references, uint first, uint count,
                                        const PreparedRay* q, uint any, Found* found, uint2* visited) {
  bool taken = false;
  for (uint i = first; i < first + count && !(taken && any); ++i) {
    ++visited->y;
    if (intersect_triangle(triangles, references[i], q, found)) taken = true;
  }
  return taken;
}
#endif
