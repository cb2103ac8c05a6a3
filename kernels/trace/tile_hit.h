// From what was found on a tile to a hit: the place on the tile and the geometric normal.
#ifndef RBVH_TILE_HIT_H
#define RBVH_TILE_HIT_H
#include "kernels/common/no_hit.h"
#include "kernels/trace/leaf_block.h"

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

static ALWAYS_INLINE void name_primitive(const Tree* tree, uint at, Hit* h) {
  __global const LeafBlock* block = tree->blocks + at / LEAF_BLOCK_WIDTH;
  h->leaf = block->leaf;
  h->flags = RBVH_HIT_TRIANGLE_LEAF | ((uint)block->places[at % LEAF_BLOCK_WIDTH] << RBVH_HIT_PRIMITIVE);
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
    n = unit_normal(tree, found->at);
#ifdef DISCS
    const float2 place = place_on_disc(tree, found->at, origin, d, found->t);
#else
    const float2 place = (float2)(found->u, found->v);
#endif
    h.u = place.x;
    h.v = place.y;
    name_primitive(tree, found->at, &h);
  }
  h.t = found->t;
  h.normal[0] = n.x;
  h.normal[1] = n.y;
  h.normal[2] = n.z;
  if (dot(n, d) > 0.0f) h.flags |= RBVH_HIT_BACK_FACE;
  return h;
}

static ALWAYS_INLINE bool is_primitive(const Tree* tree, uint id) {
  return id >= tree->tile_count && id != RBVH_NO_LEAF;
}

// What make_hit() computes, for 16 rays at once, as far as they hit triangles.
typedef struct HitLanes {
  float normal[3][16];
  uint back;  // as bits
} HitLanes;

static ALWAYS_INLINE void make_lanes(const Tree* tree, const FoundLanes* found, const float16* d,
                                     HitLanes* lanes) {
#ifndef DISCS
  float corners[3][3][16];
  bool any = false;
  for (uint i = 0; i < 16; ++i) {
    if (!is_primitive(tree, found->id[i])) continue;
    any = true;
    __global const LeafBlock* b = tree->blocks + found->at[i] / LEAF_BLOCK_WIDTH;
    for (uint k = 0; k < 3; ++k) {
      const float3 corner = block_vertex(tree, b, b->corners[k][found->at[i] % LEAF_BLOCK_WIDTH]);
      corners[k][0][i] = corner.x;
      corners[k][1][i] = corner.y;
      corners[k][2][i] = corner.z;
    }
  }
  if (!any) return;
  float16 c[3][3], n[3];
  for (uint k = 0; k < 3; ++k)
    for (uint axis = 0; axis < 3; ++axis) c[k][axis] = vload16(0, corners[k][axis]);
  triangle_normals16(c[0], c[1], c[2], n);
  for (uint axis = 0; axis < 3; ++axis) vstore16(n[axis], 0, lanes->normal[axis]);
  lanes->back = lane_bits16(n[0] * d[0] + n[1] * d[1] + n[2] * d[2] > 0.0f);
#endif
}

static ALWAYS_INLINE Hit lane_hit(const Tree* tree, const FoundLanes* found, const HitLanes* l, uint i,
                                  const Ray* ray) {
#ifndef DISCS
  if (is_primitive(tree, found->id[i])) {
    Hit h;
    h.t = found->t[i];
    for (uint axis = 0; axis < 3; ++axis) h.normal[axis] = l->normal[axis][i];
    h.u = found->u[i];
    h.v = found->v[i];
    name_primitive(tree, found->at[i], &h);
    if (l->back >> i & 1) h.flags |= RBVH_HIT_BACK_FACE;
    return h;
  }
#endif
  const Found alone = {found->t[i], found->u[i], found->v[i], found->id[i], found->at[i]};
  return make_hit(tree, &alone, ray);
}
#endif
