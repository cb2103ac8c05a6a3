// Sixteen rays side by side: placed into an object's space, tested against a box, prepared.
#ifndef RBVH_RAY_LANES_H
#define RBVH_RAY_LANES_H
#include "kernels/bvh/prepared_ray.h"
#include "kernels/common/lanes.h"

#define PACKET 16

typedef struct RayLanes {
  float16 origin[3], direction[3], tmin, tmax;
  uint used;  // as bits
} RayLanes;

// `count` rays; lanes beyond repeat the first.
static inline void load_lanes(const Ray* rays, uint count, RayLanes* lanes) {
  for (uint part = 0; part < 2; ++part) {
    float16 quads[4], rows[4];
    for (uint k = 0; k < 4; ++k) {
#define QUAD(i) vload4(0, (const float*)(rays + ((i) < count ? (i) : 0)) + 4 * part)
      quads[k] = (float16)(QUAD(k), QUAD(k + 4), QUAD(k + 8), QUAD(k + 12));
#undef QUAD
    }
    transpose4(quads, rows);
    float16* to = part == 0 ? lanes->origin : lanes->direction;
    for (uint axis = 0; axis < 3; ++axis) to[axis] = rows[axis];
    *(part == 0 ? &lanes->tmin : &lanes->tmax) = rows[3];
  }
  lanes->used = (1u << count) - 1;
}

// object_ray() for sixteen rays.
static inline void place_lanes(const float* to_object, const RayLanes* world, RayLanes* placed) {
  const float16 *o = world->origin, *d = world->direction;
  for (uint row = 0; row < 3; ++row) {
    const float* m = to_object + 4 * row;
    placed->origin[row] = m[0] * o[0] + m[1] * o[1] + m[2] * o[2] + m[3];
    placed->direction[row] = m[0] * d[0] + m[1] * d[1] + m[2] * d[2];
  }
  placed->tmin = world->tmin;
  placed->tmax = world->tmax;
  placed->used = world->used;
}

// Rays that intersect a box before `limits`, as bits: by the arithmetic of prepare() and
// intersect_children().
static inline uint intersect_box_lanes(const RayLanes* rays, const BvhRoot* box, float16 limits) {
  float16 reach = 0.0f, longest = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 o = rays->origin[axis];
    reach = max(reach, max(fabs(o), max(fabs(box->lo[axis] - o), fabs(box->hi[axis] - o))));
    longest = max(longest, fabs(rays->direction[axis]));
  }
  const float16 margin = 1.2e-6f * reach;  // error_bound()
  float16 enter = rays->tmin, leave = limits;
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 o = rays->origin[axis], d = rays->direction[axis];
    const float16 inverse = select(copysign(1e18f / longest, d), 1.0f / d, fabs(d) > 1e-18f * longest);
    const float16 outwards = copysign(margin, inverse);
    const float16 near = select((float16)(box->lo[axis]), (float16)(box->hi[axis]), inverse < 0.0f),
                  far = select((float16)(box->hi[axis]), (float16)(box->lo[axis]), inverse < 0.0f);
    enter = max(enter, mad(near, inverse, -(o + outwards) * inverse));
    leave = min(leave, mad(far, inverse, -(o - outwards) * inverse));
  }
  return lane_bits16(enter <= leave) & rays->used;
}

// Prepared rays side by side; `valid`: rays that can hit anything, as bits.
typedef struct PreparedLanes {
  float origin[3][PACKET], direction[3][PACKET], tmin[PACKET];
  float margin[PACKET];  // error_bound()
  float sx[PACKET], sy[PACKET], sz[PACKET];
  float inverse[3][PACKET], near_offset[3][PACKET], far_offset[3][PACKET];
  uint kz[PACKET];
  uint valid;
} PreparedLanes;

// The same arithmetic as prepare().
static inline void prepare_lanes(const RayLanes* rays, const BvhRoot* scene, PreparedLanes* q) {
  const float16 *o = rays->origin, *d = rays->direction;
  int16 valid = rays->tmin <= rays->tmax;
  float16 reach = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    valid &= isfinite(o[axis]) & isfinite(d[axis]);
    reach =
        max(reach, max(fabs(o[axis]), max(fabs(scene->lo[axis] - o[axis]), fabs(scene->hi[axis] - o[axis]))));
  }
  const float16 x = fabs(d[0]), y = fabs(d[1]), z = fabs(d[2]), xy = y > x ? y : x;
  const int16 is_y = y > x, is_z = z > xy;
  const float16 longest = is_z ? z : xy;
  q->valid = lane_bits16(valid & (longest > 0.0f)) & rays->used;
#define ALONG(first, second, third) (is_z ? (third) : is_y ? (second) : (first))
  vstore16(ALONG((uint16)(0), (uint16)(1), (uint16)(2)), 0, q->kz);
  const float16 along = ALONG(d[0], d[1], d[2]);
  vstore16(ALONG(d[1], d[2], d[0]) / along, 0, q->sx);
  vstore16(ALONG(d[2], d[0], d[1]) / along, 0, q->sy);
#undef ALONG
  vstore16(1.0f / along, 0, q->sz);
  vstore16(rays->tmin, 0, q->tmin);
  const float16 margin = 1.2e-6f * reach;
  vstore16(margin, 0, q->margin);
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 inverse =
        select(copysign(1e18f / longest, d[axis]), 1.0f / d[axis], fabs(d[axis]) > 1e-18f * longest);
    const float16 outwards = copysign(margin, inverse);
    vstore16(o[axis], 0, q->origin[axis]);
    vstore16(d[axis], 0, q->direction[axis]);
    vstore16(inverse, 0, q->inverse[axis]);
    vstore16(-(o[axis] + outwards) * inverse, 0, q->near_offset[axis]);
    vstore16(-(o[axis] - outwards) * inverse, 0, q->far_offset[axis]);
  }
}

// Ray i, prepared.
static inline void prepared_ray_of(const PreparedLanes* lanes, uint i, PreparedRay* q) {
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
  q->kx = q->kz == 2 ? 0 : q->kz + 1;
  q->ky = q->kz == 0 ? 2 : q->kz - 1;
  q->ox = lanes->origin[q->kx][i];
  q->oy = lanes->origin[q->ky][i];
  q->oz = lanes->origin[q->kz][i];
  q->sx = lanes->sx[i];
  q->sy = lanes->sy[i];
  q->sz = lanes->sz[i];
}

// All rays' prepared.
static ALWAYS_INLINE void prepared_rays_of(const PreparedLanes* lanes, PreparedRay* prepared) {
#define ROW(name) vload16(0, lanes->name)
  const uint16 kz = ROW(kz), kx = select(kz + 1, (uint16)(0), kz == 2),
               ky = select(kz - 1, (uint16)(2), kz == 0);
#define ALONG(k) select(select(ROW(origin[0]), ROW(origin[1]), (k) == 1), ROW(origin[2]), (k) == 2)
#define PLANE_ROW(axis, if_negative, else_) \
  as_float16(select((uint16)(else_), (uint16)(if_negative), ROW(inverse[axis]) < 0.0f))
  const float16 rows[8][4] = {
      {ROW(origin[0]), ROW(origin[1]), ROW(origin[2]), ROW(direction[0])},
      {ROW(direction[1]), ROW(direction[2]), ROW(tmin), as_float16(kx)},
      {as_float16(ky), as_float16(kz), ALONG(kx), ALONG(ky)},
      {ALONG(kz), ROW(sx), ROW(sy), ROW(sz)},
      {ROW(inverse[0]), ROW(inverse[1]), ROW(inverse[2]), ROW(near_offset[0])},
      {ROW(near_offset[1]), ROW(near_offset[2]), ROW(far_offset[0]), ROW(far_offset[1])},
      {ROW(far_offset[2]), PLANE_ROW(0, 3, 0), PLANE_ROW(1, 4, 1), PLANE_ROW(2, 5, 2)},
      {PLANE_ROW(0, 0, 3), PLANE_ROW(1, 1, 4), PLANE_ROW(2, 2, 5), 0.0f}};
#undef PLANE_ROW
#undef ALONG
#undef ROW
#pragma unroll
  for (uint part = 0; part < 8; ++part)
    store_transposed4(rows[part], sizeof(PreparedRay) / sizeof(float), (float*)prepared + 4 * part);
}
#endif
