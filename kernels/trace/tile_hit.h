// From what was found on a tile to a hit: the place on the tile and the geometric normal.
#ifndef RBVH_TILE_HIT_H
#define RBVH_TILE_HIT_H
#include "kernels/common/no_hit.h"
#include "kernels/trace/block_hit.h"

#pragma OPENCL FP_CONTRACT ON

// Defines  void NAME(tree, tile, u, v, du, dv): the gradient of a tile's height at u, v, in quanta a texel.
// Where a corner is missing, the slope along the edge that is there stands for it. F, I, ...: as for
// DEFINE_REFINE.
#define DEFINE_HEIGHT_SLOPE(NAME, F, I, CONVERT, CONVERT_INT, READ, ARE_IN_BOUNDS)                          \
  static ALWAYS_INLINE void NAME(const Tree* tree, __global const RbvhTile* tile, F u, F v, F* du, F* dv) { \
    const int width = tile->width, height = tile->height;                                                   \
    const I x = clamp(CONVERT_INT(u), (I)(0), (I)(width - 2)),                                              \
            y = clamp(CONVERT_INT(v), (I)(0), (I)(height - 2));                                             \
    const F fu = u - CONVERT(x), fv = v - CONVERT(y);                                                       \
    const I at = y * width + x;                                                                             \
    *du = *dv = 0.0f;                                                                                       \
    if (!ARE_IN_BOUNDS(tree->bounds, tile->offset, at)) return;                                             \
    if (!ARE_IN_BOUNDS(tree->bounds, tile->offset, at + width + 1)) return;                                 \
    __global const ushort* p = tree->heights + tile->offset;                                                \
    const F a = CONVERT(READ(p, at)), b = CONVERT(READ(p + 1, at)), c = CONVERT(READ(p + width, at)),       \
            d = CONVERT(READ(p + width + 1, at)), none = NAN;                                               \
    const F ab = select(none, b - a, (a > 0.0f) & (b > 0.0f)),                                              \
            cd = select(none, d - c, (c > 0.0f) & (d > 0.0f)),                                              \
            ac = select(none, c - a, (a > 0.0f) & (c > 0.0f)),                                              \
            bd = select(none, d - b, (b > 0.0f) & (d > 0.0f));                                              \
    *du = select(select(ab + (cd - ab) * fv, ab, isnan(cd)), cd, isnan(ab));                                \
    *dv = select(select(ac + (bd - ac) * fu, ac, isnan(bd)), bd, isnan(ac));                                \
    *du = select(*du, (F)(0.0f), isnan(*du));                                                               \
    *dv = select(*dv, (F)(0.0f), isnan(*dv));                                                               \
  }

DEFINE_HEIGHT_SLOPE(height_slope, float, int, (float), (int), READ_ONE, ONE_IN_BOUNDS)
DEFINE_HEIGHT_SLOPE(height_slope16, float16, int16, convert_float16, convert_int16, gather16, ALL_IN_BOUNDS)

static ALWAYS_INLINE Hit make_hit(const Tree* tree, const Found* found, const Ray* ray) {
  if (found->id == RBVH_NO_LEAF) return no_hit();
  if (found->id >= tree->tile_count) return make_block_hit(tree, found, ray);
  Hit h = no_hit();
  const float3 d = vload3(0, ray->direction), origin = vload3(0, ray->origin);
  __global const RbvhTile* tile = tree->tiles + found->id;
  __global const float* m = tile->columns;
  const float3 ru = (float3)(m[0], m[3], m[6]), rv = (float3)(m[1], m[4], m[7]),
               rw = (float3)(m[2], m[5], m[8]), p = origin + d * found->t;
  const float u = dot(ru, p) + m[9], v = dot(rv, p) + m[10];
  // Of w - h(u, v), with rows of world length 1 / texel and 1 / quantum.
  float du, dv;
  height_slope(tree, tile, u, v, &du, &dv);
  const float3 n = normalize(rw - ru * du - rv * dv);
  h.t = found->t;
  h.normal[0] = n.x;
  h.normal[1] = n.y;
  h.normal[2] = n.z;
  h.u = clamp(u / (float)(tile->width - 1), 0.0f, 1.0f);
  h.v = clamp(v / (float)(tile->height - 1), 0.0f, 1.0f);
  h.leaf = tile->leaf;
  h.flags = dot(n, d) > 0.0f ? RBVH_HIT_BACK_FACE : 0u;
  return h;
}

// What make_hit() computes, for rays that hit one tile: those of `which`.
static ALWAYS_INLINE void put_tile_hits(const Tree* tree, uint id, const Found16* found, const float16* o,
                                        const float16* d, int16 which, HitLanes* h) {
  __global const RbvhTile* tile = tree->tiles + id;
  __global const float* m = tile->columns;
  const float16 p[3] = {o[0] + d[0] * found->t, o[1] + d[1] * found->t, o[2] + d[2] * found->t};
  const float16 u = m[0] * p[0] + m[3] * p[1] + m[6] * p[2] + m[9],
                v = m[1] * p[0] + m[4] * p[1] + m[7] * p[2] + m[10];
  float16 du, dv;
  height_slope16(tree, tile, u, v, &du, &dv);
  float16 n[3];
  for (uint axis = 0; axis < 3; ++axis) {
    __global const float* column = m + 3 * axis;
    n[axis] = column[2] - column[0] * du - column[1] * dv;
  }
  normalize16(n);
  for (uint axis = 0; axis < 3; ++axis) h->normal[axis] = select(h->normal[axis], n[axis], which);
  h->u = select(h->u, clamp(u / (float)(tile->width - 1), 0.0f, 1.0f), which);
  h->v = select(h->v, clamp(v / (float)(tile->height - 1), 0.0f, 1.0f), which);
  h->leaf = select(h->leaf, (uint16)(tile->leaf), which);
}

// What make_hit() computes, for 16 rays at once.
static ALWAYS_INLINE void make_hits16(const Tree* tree, const Found16* found, const float16* o,
                                      const float16* d, HitLanes* h) {
  no_hits(h);
  const int16 hit = found->id != RBVH_NO_LEAF, on_tile = found->id < tree->tile_count, other = hit & ~on_tile;
  h->t = select(h->t, found->t, hit);
  if (lane_bits16(other) != 0) put_block_hits(tree, found, o, d, other, h);
  uint id[16];
  vstore16(found->id, 0, id);
  for (uint left = lane_bits16(on_tile); left != 0;) {
    const uint tile = id[lowest_bit(left)];
    const int16 alike = found->id == tile;
    left &= ~lane_bits16(alike);
    put_tile_hits(tree, tile, found, o, d, alike, h);
  }
  mark_back_faces(d, h);
}
#endif
