// The test of a NodePair's two boxes against one ray.
#ifndef RBVH_NODE_PAIR_H
#define RBVH_NODE_PAIR_H
#include "kernels/bvh/prepared_ray.h"

// Bit 0, bit 1: the ray enters the child between tmin and `limit`. `entry`: where, tmin where the ray begins
// inside; it does not depend on `limit`.
static inline uint intersect_pair(__global const NodePair* node, const PreparedRay* q, float limit,
                                  float2* entry) {
#define PLANES(row, i, offset) \
  mad(vload2(0, node->planes[q->row[i]]), (float2)(q->inverse[i]), (float2)(q->offset[i]))
  const float2 enter = max(max(PLANES(near_row, 0, near_offset), PLANES(near_row, 1, near_offset)),
                           max(PLANES(near_row, 2, near_offset), (float2)(q->tmin)));
  const float2 leave = min(min(PLANES(far_row, 0, far_offset), PLANES(far_row, 1, far_offset)),
                           min(PLANES(far_row, 2, far_offset), (float2)(limit)));
#undef PLANES
  *entry = enter;
  return (enter.x <= leave.x ? 1u : 0u) | (enter.y <= leave.y ? 2u : 0u);
}
#endif
