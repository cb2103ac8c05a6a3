// Sixteen prepared rays, to be traced one by one.
#ifndef RBVH_QUERY_LANES_H
#define RBVH_QUERY_LANES_H
#include "kernels/bvh/ray_query.h"
#include "kernels/common/lanes.h"

#pragma OPENCL FP_CONTRACT OFF

// Query, by lane; and the rays' tmax.
typedef struct QueryLanes {
  float origin[3][16], direction[3][16], tmin[16], tmax[16];
  uint kz[16];
  float sx[16], sy[16], sz[16];
  float inverse[3][16], near_offset[3][16], far_offset[3][16];
  uint can_hit;  // prepare()'s result, as bits
} QueryLanes;

// prepare()'s arithmetic. Of `used` rays; the other lanes can hit nothing.
static ALWAYS_INLINE void prepare_lanes(__global const Ray* rays, uint used, const BvhRoot* scene, float16* d,
                                        QueryLanes* q) {
  const int16 lane = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  const int16 at = min(lane, (int16)((int)used - 1)) * 8;
  __global const float* numbers = (__global const float*)rays;  // of each ray origin, tmin, direction, tmax
  float16 origin[3];
  for (uint axis = 0; axis < 3; ++axis) {
    origin[axis] = gather_floats16(numbers + axis, at);
    d[axis] = gather_floats16(numbers + 4 + axis, at);
    vstore16(origin[axis], 0, q->origin[axis]);
    vstore16(d[axis], 0, q->direction[axis]);
  }
  const float16 tmin = gather_floats16(numbers + 3, at), tmax = gather_floats16(numbers + 7, at);
  vstore16(tmin, 0, q->tmin);
  vstore16(min(tmax, FLT_MAX), 0, q->tmax);
  const float16 x = fabs(d[0]), y = fabs(d[1]), z = fabs(d[2]), longest = max(x, max(y, z));
  // x - x is 0 for finite numbers only.
  float16 finite = 0.0f, farthest = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    finite += (origin[axis] - origin[axis]) + (d[axis] - d[axis]);
    farthest = max(farthest, max(fabs(scene->lo[axis] - origin[axis]), fabs(scene->hi[axis] - origin[axis])));
    farthest = max(farthest, fabs(origin[axis]));
  }
  q->can_hit = lane_bits16((finite == 0.0f) & (longest > 0.0f) & (tmin <= tmax)) & ((1u << used) - 1);
  const int16 along_x = (x >= y) & (x >= z), along_y = ~along_x & (y >= z);
  const float16 dz = select(select(d[2], d[1], along_y), d[0], along_x);
  vstore16(convert_uint16(select(select((int16)(2), (int16)(1), along_y), (int16)(0), along_x)), 0, q->kz);
  vstore16(select(select(d[0], d[2], along_y), d[1], along_x) / dz, 0, q->sx);
  vstore16(select(select(d[1], d[0], along_y), d[2], along_x) / dz, 0, q->sy);
  vstore16(1.0f / dz, 0, q->sz);
  const float16 margin = 1.2e-6f * farthest, parallel_limit = 1e-18f * longest;
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 inverse =
        select(copysign(1e18f / longest, d[axis]), 1.0f / d[axis], fabs(d[axis]) > parallel_limit);
    const float16 outwards = copysign(margin, inverse);
    vstore16(inverse, 0, q->inverse[axis]);
    vstore16(-(origin[axis] + outwards) * inverse, 0, q->near_offset[axis]);
    vstore16(-(origin[axis] - outwards) * inverse, 0, q->far_offset[axis]);
  }
}

// The query of a lane; returns its tmax.
static ALWAYS_INLINE float lane_query(const QueryLanes* lanes, uint i, Query* q) {
  for (uint axis = 0; axis < 3; ++axis) {
    q->origin[axis] = lanes->origin[axis][i];
    q->direction[axis] = lanes->direction[axis][i];
    q->inverse[axis] = lanes->inverse[axis][i];
    q->near_offset[axis] = lanes->near_offset[axis][i];
    q->far_offset[axis] = lanes->far_offset[axis][i];
    q->near_row[axis] = q->inverse[axis] < 0.0f ? axis + 3 : axis;
    q->far_row[axis] = q->inverse[axis] < 0.0f ? axis : axis + 3;
  }
  q->tmin = lanes->tmin[i];
  q->kz = lanes->kz[i];
  q->kx = (q->kz + 1) % 3;
  q->ky = (q->kz + 2) % 3;
  q->sx = lanes->sx[i];
  q->sy = lanes->sy[i];
  q->sz = lanes->sz[i];
  return lanes->tmax[i];
}
#endif
