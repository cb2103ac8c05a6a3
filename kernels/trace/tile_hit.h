// From what was found on a tile to a hit: the place on the tile and the geometric normal.
#ifndef RBVH_TILE_HIT_H
#define RBVH_TILE_HIT_H
#include "kernels/bvh/primitive_block.h"
#include "kernels/common/no_hit.h"
#include "kernels/trace/tile_tree.h"

#pragma OPENCL FP_CONTRACT ON

// The gradient of a tile's height at u, v, in quanta a texel. Where a corner is missing, the slope along the
// edge that is there stands for it.
static ALWAYS_INLINE float2 height_slope(const Tree* tree, __global const RbvhTile* tile, float u, float v) {
  const int width = tile->width, height = tile->height;
  const int x = clamp((int)u, 0, width - 2), y = clamp((int)v, 0, height - 2);
  const float fu = u - (float)x, fv = v - (float)y;
  const uint at = (uint)(y * width + x);
  if (!IN_BOUNDS(tree->bounds, HEIGHTS, (ulong)tile->offset + at, (ulong)width + 2)) return 0.0f;
  __global const ushort* q = tree->heights + tile->offset + at;
  const float a = (float)q[0], b = (float)q[1], c = (float)q[width], d = (float)q[width + 1];
  const float ab = a != 0.0f && b != 0.0f ? b - a : NAN, cd = c != 0.0f && d != 0.0f ? d - c : NAN;
  const float ac = a != 0.0f && c != 0.0f ? c - a : NAN, bd = b != 0.0f && d != 0.0f ? d - b : NAN;
  const float du = isnan(ab) ? cd : isnan(cd) ? ab : ab + (cd - ab) * fv;
  const float dv = isnan(ac) ? bd : isnan(bd) ? ac : ac + (bd - ac) * fu;
  return (float2)(isnan(du) ? 0.0f : du, isnan(dv) ? 0.0f : dv);
}

static ALWAYS_INLINE Hit make_hit(const Tree* tree, const Found* found, const Ray* ray) {
  Hit h = no_hit();
  if (found->id == RBVH_NO_LEAF) return h;
  const float3 d = vload3(0, ray->direction), origin = vload3(0, ray->origin);
  float3 n;
  if (found->id < tree->tile_count) {
    __global const RbvhTile* tile = tree->tiles + found->id;
    __global const float* m = tile->columns;
    const float3 ru = (float3)(m[0], m[3], m[6]), rv = (float3)(m[1], m[4], m[7]),
                 rw = (float3)(m[2], m[5], m[8]), p = origin + d * found->t;
    const float u = dot(ru, p) + m[9], v = dot(rv, p) + m[10];
    // Of w - h(u, v), with rows of world length 1 / texel and 1 / quantum.
    const float2 slope = height_slope(tree, tile, u, v);
    n = normalize(rw - ru * slope.x - rv * slope.y);
    h.u = clamp(u / (float)(tile->width - 1), 0.0f, 1.0f);
    h.v = clamp(v / (float)(tile->height - 1), 0.0f, 1.0f);
    h.leaf = tile->leaf;
  } else {
    const uint primitive = found->id - tree->tile_count;
    if (!IN_BOUNDS(tree->bounds, LEAF_OF, primitive, 1)) return h;
    n = unit_normal(tree->blocks, found->at);
#ifdef DISCS
    const float2 place = place_on_disc(tree->blocks, found->at, origin, d, found->t);
#else
    const float2 place = (float2)(found->u, found->v);
#endif
    h.u = place.x;
    h.v = place.y;
    h.leaf = tree->leaf_of[primitive];
    h.flags = RBVH_HIT_TRIANGLE_LEAF | ((uint)tree->place_of[primitive] << RBVH_HIT_PRIMITIVE);
  }
  h.t = found->t;
  h.normal[0] = n.x;
  h.normal[1] = n.y;
  h.normal[2] = n.z;
  if (dot(n, d) > 0.0f) h.flags |= RBVH_HIT_BACK_FACE;
  return h;
}

// What a packet found, by ray.
typedef struct HitLanes {
  float origin[3], d[3][16], t[16], u[16], v[16];
  uint id[16], at[16];
} HitLanes;

static ALWAYS_INLINE void make_lanes(const Tree* tree, const Found16* found, const Packet* p,
                                     HitLanes* lanes) {
  for (uint axis = 0; axis < 3; ++axis) {
    lanes->origin[axis] = p->origin[axis];
    vstore16(p->d[axis], 0, lanes->d[axis]);
  }
  vstore16(found->t, 0, lanes->t);
  vstore16(found->u, 0, lanes->u);
  vstore16(found->v, 0, lanes->v);
  vstore16(found->id, 0, lanes->id);
  vstore16(found->at, 0, lanes->at);
}

static ALWAYS_INLINE Hit lane_hit(const Tree* tree, const HitLanes* l, uint i) {
  const Ray ray = {
      {l->origin[0], l->origin[1], l->origin[2]}, 0.0f, {l->d[0][i], l->d[1][i], l->d[2][i]}, INFINITY};
  const Found found = {l->t[i], l->u[i], l->v[i], l->id[i], l->at[i]};
  return make_hit(tree, &found, &ray);
}
#endif
