// The test of one box against one ray.
#ifndef RBVH_BOX_H
#define RBVH_BOX_H
#include "kernels/bvh/prepared_ray.h"

// Where the ray enters the box (not before tmin) and leaves it, moved outwards by the error bound. It hits
// the box where the first is not greater than the second.
static inline float2 box_interval(float3 lo, float3 hi, const PreparedRay* q) {
  const bool x = q->near_row[0] > 2, y = q->near_row[1] > 2, z = q->near_row[2] > 2;
  const float enter = max(max(mad(x ? hi.x : lo.x, q->inverse[0], q->near_offset[0]),
                              mad(y ? hi.y : lo.y, q->inverse[1], q->near_offset[1])),
                          max(mad(z ? hi.z : lo.z, q->inverse[2], q->near_offset[2]), q->tmin));
  const float leave = min(min(mad(x ? lo.x : hi.x, q->inverse[0], q->far_offset[0]),
                              mad(y ? lo.y : hi.y, q->inverse[1], q->far_offset[1])),
                          mad(z ? lo.z : hi.z, q->inverse[2], q->far_offset[2]));
  return (float2)(enter, leave);
}
#endif
