// One ray marches a tile, sixteen grid lines at a time.
#ifndef RBVH_MARCH_RAY_H
#define RBVH_MARCH_RAY_H
#include "kernels/bvh/prepared_ray.h"
#include "kernels/trace/march.h"

#pragma OPENCL FP_CONTRACT ON

// Each lane's right neighbour; its left one.
#define NEXT(v) (v).s123456789abcdeff
#define PREVIOUS(v) (v).s00123456789abcde

// The piece of a ray above a tile's grid.
typedef struct TileRay {
  float o[3], d[3];  // in tile space
  float t0, t1;
} TileRay;

// False where the ray misses the tile's slab, between its rectangle's edges and 0 and the greatest height.
static ALWAYS_INLINE bool enter_tile(__global const RbvhTile* tile, const PreparedRay* q, float limit,
                                     TileRay* r) {
  const float* o = q->origin;
  const float* d = q->direction;
  __global const float* m = tile->columns;
  const float4 mx = vload4(0, m), my = vload4(0, m + 3), mz = vload4(0, m + 6);
  const float4 ot = mx * o[0] + my * o[1] + mz * o[2] + (float4)(vload3(3, m), 0.0f);
  const float4 dm = mx * d[0] + my * d[1] + mz * d[2];
  const float4 dt = select(dm, copysign((float4)(1e-20f), dm), fabs(dm) < 1e-20f);
  const float4 inverse = 1.0f / dt;
  // One quantum of room above: a level surface has no thickness, and rounding must not lose it.
  const float4 ta = ((float4)(0.0f, 0.0f, 0.0f, 0.0f) - ot) * inverse;
  const float4 tb =
      ((float4)((float)(tile->width - 1), (float)(tile->height - 1), tile->top + 1.0f, 0.0f) - ot) * inverse;
  const float4 t_in = min(ta, tb), t_out = max(ta, tb);
  r->t0 = max(max(t_in.x, t_in.y), max(t_in.z, q->tmin));
  r->t1 = min(min(t_out.x, t_out.y), min(t_out.z, limit));
  r->o[0] = ot.x;
  r->o[1] = ot.y;
  r->o[2] = ot.z;
  r->d[0] = dt.x;
  r->d[1] = dt.y;
  r->d[2] = dt.z;
  return r->t0 <= r->t1;
}

// Takes the first crossing of the tile where it is nearer than what was found. Counts lines by sixteen.
static ALWAYS_INLINE bool march(const Tree* tree, uint id, const PreparedRay* q, Found* found,
                                uint2* visited) {
  __global const RbvhTile* tile = tree->tiles + id;
  TileRay r;
  if (!enter_tile(tile, q, found->t, &r)) return false;
  const int width = tile->width, height = tile->height;
  const bool along_u = fabs(r.d[0]) >= fabs(r.d[1]);
  const float o_major = along_u ? r.o[0] : r.o[1], toward = along_u ? r.d[0] : r.d[1];
  // A ray along w crosses no line within the slab: tilt it by less than a thousandth of a texel.
  const float d_major = copysign(max(fabs(toward), 1e-8f * fabs(r.d[2])), toward);
  const int n_major = along_u ? width : height;
  GridRay g;
  g.o_major = o_major;
  g.d_major = d_major;
  g.i_major = 1.0f / d_major;
  g.o_minor = along_u ? r.o[1] : r.o[0];
  g.d_minor = along_u ? r.d[1] : r.d[0];
  g.ow = r.o[2];
  g.dw = r.d[2];
  g.last_line = n_major - 1;
  g.last_row = (along_u ? height : width) - 2;
  g.s_major = along_u ? 1 : width;
  g.s_minor = along_u ? width : 1;
  const int step = d_major > 0.0f ? 1 : -1;
  const float enter = o_major + d_major * r.t0;
  int k = clamp((int)(d_major > 0.0f ? floor(enter - 1e-3f) : ceil(enter + 1e-3f)), 0, n_major - 1);
  const int16 lanes = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  for (;;) {
    const float16 line = convert_float16(k + step * lanes);
    float16 t;
    int16 row;
    const float16 D = sample_line(tree, tile, &g, line, &t, &row);
    Segments s = {t, D, NEXT(t), NEXT(D)};
    const int16 cut = is_cut(&s, &g, tile->step_limit) & (row != NEXT(row)) & (t < r.t1);
    if (lane_bits16(cut) & 0x7fffu)
      shorten(tree, tile, &g, &s, cut, line, (float16)((float)step), max(row, NEXT(row)));
    const int16 grazed = is_grazed(PREVIOUS(D), D, NEXT(D), tile->step_limit);
    uint crossed = lane_bits16(((s.from_D * s.to_D <= 0.0f) | grazed) & (t < r.t1)) & 0x7fffu;
    visited->y += 1;
    while (crossed) {
      const uint i = lowest_bit(crossed);
      crossed &= crossed - 1u;
      float from_t[16], to_t[16], from_D[16], to_D[16];
      vstore16(s.from_t, 0, from_t);
      vstore16(s.to_t, 0, to_t);
      vstore16(s.from_D, 0, from_D);
      vstore16(s.to_D, 0, to_D);
      float hit = from_t[i];
      if (from_D[i] * to_D[i] <= 0.0f)
        hit = refine(tree, tile, r.o, r.d[0], r.d[1], r.d[2], from_t[i], from_D[i], to_t[i], to_D[i]);
      const float length = to_t[i] - from_t[i];
      if (hit >= q->tmin && is_nearer(hit, id, found) && hit >= r.t0 - length && hit <= r.t1 + length &&
          INSIDE(tile, q->origin[0] + q->direction[0] * hit, q->origin[1] + q->direction[1] * hit,
                 q->origin[2] + q->direction[2] * hit)) {
        found->t = hit;
        found->id = id;
        return true;
      }
    }
    k += 15 * step;
    if (k < 0 || k >= n_major || greatest(t) >= r.t1) return false;
  }
}
#endif
