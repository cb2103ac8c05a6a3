// Ray casting an RBVH (Novak & Dachsbacher 2012, section 5): a wide top tree over the tiles, a march over a
// tile's height field, a refined hit.
//
// Marching. In tile space a ray crosses the grid lines of its major axis (the one of u, v that it moves along
// faster) one after the other. On a line the surface is the linear interpolation of two texels, so the
// difference D between the ray's and the surface's w needs two reads, and the surface is one and the same for
// the cells on both sides: no crack inside a tile. A change of sign between two lines is a hit; its place is
// found by a secant and one Newton step on the bilinear patch. Texels of height 0 are empty. Neighbours
// further apart than `step_limit` are two surfaces: no wall is drawn between them. Both make D NaN, and NaN
// never changes sign.
//
// Layouts (all 32-bit words):
//   node of width N: lo.x[N] lo.y[N] lo.z[N] hi.x[N] hi.y[N] hi.z[N] child[N];
//     child >= 0: node; < 0: tile ~child; an empty slot is a far degenerate box (lo = hi = 1e38).
//   tile: RbvhTile.
#include "kernels/common/bounds.h"
#include "kernels/common/camera_rays.h"
#include "kernels/common/lanes.h"
#include "kernels/common/layout.h"
#include "kernels/common/no_hit.h"

#ifndef RBVH_STACK
#define RBVH_STACK 192
#endif
#define FAR 1e20f
// A ray that comes so near to the surface on a line, in parts of the step limit (8 texels), and goes away
// again, hits.
#define GRAZE (0.05f / 8.0f)

typedef RbvhTile Tile;

// A level, as the first five arguments of every kernel here, and their names in IN_BOUNDS.
typedef struct Level {
  __global const uint* nodes;
  __global const Tile* tiles;
  __global const ushort* heights;
  __global const RbvhChunk* exact;
  uint discs;  // what they are; else triangles
  BOUNDS_MEMBER
} Level;
#define NODES 0u, sizeof(uint)
#define TILES 1u, sizeof(Tile)
#define HEIGHTS 2u, sizeof(ushort)
#define EXACT 3u, sizeof(RbvhChunk)

// Sixteen points at a time or one: inside the leaf's box?
#define INSIDE(tile, x, y, z)                                                                          \
  (((x) >= (tile)->lo[0]) & ((x) <= (tile)->hi[0]) & ((y) >= (tile)->lo[1]) & ((y) <= (tile)->hi[1]) & \
   ((z) >= (tile)->lo[2]) & ((z) <= (tile)->hi[2]))

// A direction component of zero becomes a tiny one, so that 1/d is finite and no slab test sees 0 * inf.
static inline float nonzero(float d) { return fabs(d) < 1e-20f ? copysign(1e-20f, d) : d; }

static inline float any_lo(float16 v) {
  const float8 a = min(v.lo, v.hi);
  const float4 b = min(a.lo, a.hi);
  const float2 c = min(b.lo, b.hi);
  return min(c.x, c.y);
}
static inline float any_hi(float16 v) {
  const float8 a = max(v.lo, v.hi);
  const float4 b = max(a.lo, a.hi);
  const float2 c = max(b.lo, b.hi);
  return max(c.x, c.y);
}

// --- leaves that keep their primitives
// -------------------------------------------------------------------------------

// Where rays from o meet triangles or discs; infinity or NaN for nowhere: one ray and a chunk's primitives
// side by side, or sixteen rays and one primitive. Triangles as in Woop, Benthin, Wald, "Watertight
// Ray/Triangle Intersection" (JCGT 2013): each corner is sheared along the ray onto the plane of two axes by
// itself, and triangles that share an edge find the same area beside it with opposite signs (contraction is
// off): no ray slips between them. kz: the axis to shear along. S: what a primitive's words are, D: what a
// ray's are, F: the wider of the two.
#pragma OPENCL FP_CONTRACT OFF
#define DEFINE_INTERSECT(NAME, S, D, F, WORD)                                                             \
  static inline F NAME(__global const RbvhChunk* c, uint lane, uint discs, const float* o, const D* d,    \
                       int kz) {                                                                          \
    if (discs) {                                                                                          \
      const S ax = WORD(0) - o[0], ay = WORD(1) - o[1], az = WORD(2) - o[2];                              \
      const S radius = WORD(3), nx = WORD(4), ny = WORD(5), nz = WORD(6);                                 \
      const F t = (nx * ax + ny * ay + nz * az) / (nx * d[0] + ny * d[1] + nz * d[2]);                    \
      const F x = d[0] * t - ax, y = d[1] * t - ay, z = d[2] * t - az;                                    \
      return select((F)(INFINITY), t, x * x + y * y + z * z <= (F)(radius * radius * 1.00002f));          \
    }                                                                                                     \
    const int kx = kz == 2 ? 0 : kz + 1, ky = kz == 0 ? 2 : kz - 1;                                       \
    const D sz = 1.0f / d[kz], sx = d[kx] * sz, sy = d[ky] * sz;                                          \
    const S az = WORD(kz) - o[kz], bz = WORD(3 + kz) - o[kz], cz = WORD(6 + kz) - o[kz];                  \
    const F ax = (WORD(kx) - o[kx]) - sx * az, ay = (WORD(ky) - o[ky]) - sy * az;                         \
    const F bx = (WORD(3 + kx) - o[kx]) - sx * bz, by = (WORD(3 + ky) - o[ky]) - sy * bz;                 \
    const F cx = (WORD(6 + kx) - o[kx]) - sx * cz, cy = (WORD(6 + ky) - o[ky]) - sy * cz;                 \
    const F u = cx * by - cy * bx, v = ax * cy - ay * cx, w = bx * ay - by * ax;                          \
    return select((F)(INFINITY), (u * az + v * bz + w * cz) * sz / (u + v + w),                           \
                  ((u >= 0.0f) & (v >= 0.0f) & (w >= 0.0f)) | ((u <= 0.0f) & (v <= 0.0f) & (w <= 0.0f))); \
  }
#define ALL_WORDS(row) vload8(0, c->shape[row])
#define ONE_WORD(row) c->shape[row][lane]
DEFINE_INTERSECT(intersect_chunk, float8, float, float8, ALL_WORDS)
DEFINE_INTERSECT(intersect_packet, float, float16, float16, ONE_WORD)
#pragma OPENCL FP_CONTRACT ON

static inline int longest_axis(float x, float y, float z) { return x >= y && x >= z ? 0 : y >= z ? 1 : 2; }

// Nearest crossing of the tile's primitives within (tmin, tmax), or tmax.
static inline float intersect_exact(const Level* level, __global const Tile* tile, float3 o, float3 d,
                                    float tmin, float tmax, uint* steps) {
  if (!IN_BOUNDS(level->bounds, EXACT, tile->chunk, 1)) return tmax;
  const float from[3] = {o.x, o.y, o.z}, along[3] = {d.x, d.y, d.z};
  const int kz = longest_axis(fabs(d.x), fabs(d.y), fabs(d.z));
  *steps += 1;
  const float8 t = intersect_chunk(level->exact + tile->chunk, 0, level->discs, from, along, kz);
  const float8 met = select((float8)(tmax), t, (t > tmin) & (t < tmax));
  const float4 least = min(met.lo, met.hi);
  return min(min(least.x, least.y), min(least.z, least.w));
}

// The normal of the primitive that was met at t.
static inline float3 exact_normal(const Level* level, __global const Tile* tile, float3 o, float3 d,
                                  float t) {
  if (!IN_BOUNDS(level->bounds, EXACT, tile->chunk, 1)) return -d;
  __global const RbvhChunk* c = level->exact + tile->chunk;
  const float from[3] = {o.x, o.y, o.z}, along[3] = {d.x, d.y, d.z};
  float off[RBVH_CHUNK];
  vstore8(
      fabs(intersect_chunk(c, 0, level->discs, from, along, longest_axis(fabs(d.x), fabs(d.y), fabs(d.z))) -
           t),
      0, off);
  float least = INFINITY;
  uint nearest = 0;
  for (uint k = 0; k < RBVH_CHUNK; ++k) {
    if (!(off[k] < least)) continue;
    least = off[k];
    nearest = k;
  }
  const float3 p = (float3)(c->shape[0][nearest], c->shape[1][nearest], c->shape[2][nearest]);
  const float3 q = (float3)(c->shape[3][nearest], c->shape[4][nearest], c->shape[5][nearest]);
  const float3 r = (float3)(c->shape[6][nearest], c->shape[7][nearest], c->shape[8][nearest]);
  return level->discs ? (float3)(q.y, q.z, r.x) : normalize(cross(q - p, r - p));
}

// --- tiles
// ----------------------------------------------------------------------------------------------------------

// The bilinear height of a patch, NaN where a corner is missing.
static inline float patch_height(const Level* level, uint offset, int width, int height, float u, float v) {
  const int x = clamp((int)u, 0, width - 2), y = clamp((int)v, 0, height - 2);
  const float fu = u - (float)x, fv = v - (float)y;
  if (!IN_BOUNDS(level->bounds, HEIGHTS, (ulong)offset + (ulong)(y * width + x), (ulong)width + 2))
    return NAN;
  __global const ushort* q = level->heights + offset + y * width + x;
  const float a = (float)q[0], b = (float)q[1], c = (float)q[width], d = (float)q[width + 1];
  if (a == 0.0f || b == 0.0f || c == 0.0f || d == 0.0f) return NAN;
  const float h0 = a + (b - a) * fu, h1 = c + (d - c) * fu;
  return h0 + (h1 - h0) * fv;
}

// A ray's hit on a tile, complete: position on the tile and the geometric normal in world space.
static inline void store_hit(__global Hit* hit, const Level* level, float3 origin, float3 direction, float t,
                             int leaf) {
  Hit h = no_hit();
  if (leaf >= 0) {
    __global const Tile* tile = level->tiles + leaf;
    __global const float* m = tile->columns;
    const float3 ru = (float3)(m[0], m[3], m[6]), rv = (float3)(m[1], m[4], m[7]),
                 rw = (float3)(m[2], m[5], m[8]);
    const float3 p = origin + direction * t;
    const float u = dot(ru, p) + m[9], v = dot(rv, p) + m[10];
    const int width = tile->width, height = tile->height;
    const int x = clamp((int)u, 0, width - 2), y = clamp((int)v, 0, height - 2);
    const float fu = u - (float)x, fv = v - (float)y;
    if (!IN_BOUNDS(level->bounds, HEIGHTS, (ulong)tile->offset + (ulong)(y * width + x), (ulong)width + 2))
      return;
    __global const ushort* q = level->heights + tile->offset + y * width + x;
    const float a = (float)q[0], b = (float)q[1], c = (float)q[width], d = (float)q[width + 1];
    // Where a corner is missing, the slope along the edge that is there must do.
    float du, dv;
    const float ab = a != 0.0f && b != 0.0f ? b - a : NAN, cd = c != 0.0f && d != 0.0f ? d - c : NAN;
    const float ac = a != 0.0f && c != 0.0f ? c - a : NAN, bd = b != 0.0f && d != 0.0f ? d - b : NAN;
    du = isnan(ab) ? cd : isnan(cd) ? ab : ab + (cd - ab) * fv;
    dv = isnan(ac) ? bd : isnan(bd) ? ac : ac + (bd - ac) * fu;
    du = isnan(du) ? 0.0f : du;
    dv = isnan(dv) ? 0.0f : dv;
    // Gradient of w - h(u, v), with rows of world length 1 / texel and 1 / quantum.
    const bool exact = tile->chunk != RBVH_NO_CHUNK;
    const float3 n =
        exact ? exact_normal(level, tile, origin, direction, t) : normalize(rw - ru * du - rv * dv);
    h.t = t;
    h.normal[0] = n.x;
    h.normal[1] = n.y;
    h.normal[2] = n.z;
    h.u = clamp(u / (float)(width - 1), 0.0f, 1.0f);
    h.v = clamp(v / (float)(height - 1), 0.0f, 1.0f);
    h.leaf = tile->leaf;
    h.flags = (dot(n, direction) > 0.0f ? RBVH_HIT_BACK_FACE : 0u) | (exact ? RBVH_HIT_TRIANGLE_LEAF : 0u);
  }
  *hit = h;
}

// Pieces of rays between two grid lines, and how far over the surface (D) they begin and end.
typedef struct {
  float16 from_t, from_D, to_t, to_D;
} Segments;

// One end is nowhere, and the other near enough to the surface for the ray to meet it in between.
#define NEAR \
  (2.0f / 8.0f)  // slope of the surface that is reckoned with, in parts of the step limit (8 texels)
static inline int16 is_halved(const Segments* s, float16 reach) {
  return (isnan(s->from_D) != isnan(s->to_D)) &
         (select(fabs(s->from_D), fabs(s->to_D), isnan(s->from_D)) <= reach);
}

// At a tile's rim one of the two ends may lie in the next row of cells, where a corner is missing. What is on
// this side of the line between the rows is still to be met: the segment ends there, at t_row, a fraction
// `at` of the way from texels h0 to h1, where the ray's w is `w`.
static inline void shorten(Segments* s, int16 which, float16 t_row, float16 at, float16 w, float16 h0,
                           float16 h1, float limit) {
  const int16 solid = which & (h0 > 0.0f) & (h1 > 0.0f) & (fabs(h1 - h0) <= limit);
  const float16 D = w - (h0 + (h1 - h0) * at);
  const int16 at_from = solid & isnan(s->from_D), at_to = solid & ~isnan(s->from_D);
  s->from_t = select(s->from_t, t_row, at_from);
  s->from_D = select(s->from_D, D, at_from);
  s->to_t = select(s->to_t, t_row, at_to);
  s->to_D = select(s->to_D, D, at_to);
}

// --- one ray
// --------------------------------------------------------------------------------------------------------

// Nearest crossing of the tile within (tmin, tmax), or tmax. Sixteen grid lines at a time.
static inline float march(const Level* level, int id, float3 o, float3 d, float tmin, float tmax,
                          uint* steps) {
  if (!IN_BOUNDS(level->bounds, TILES, (ulong)id, 1)) return tmax;
  __global const Tile* tile = level->tiles + id;
  if (tile->chunk != RBVH_NO_CHUNK) return intersect_exact(level, tile, o, d, tmin, tmax, steps);
  __global const float* m = tile->columns;
  const float4 mx = vload4(0, m), my = vload4(0, m + 3), mz = vload4(0, m + 6);
  const float4 ot = mx * o.x + my * o.y + mz * o.z + (float4)(vload3(3, m), 0.0f);
  const float4 lean = mx * d.x + my * d.y + mz * d.z;
  const float4 dt = select(lean, copysign((float4)(1e-20f), lean), fabs(lean) < 1e-20f);
  const int width = tile->width, height = tile->height;
  const float4 inv = 1.0f / dt;
  // One quantum of room above and below: a level surface has no thickness, and rounding must not lose it.
  const float4 ta = ((float4)(0.0f, 0.0f, 0.0f, 0.0f) - ot) * inv;
  const float4 tb = ((float4)((float)(width - 1), (float)(height - 1), tile->top + 1.0f, 0.0f) - ot) * inv;
  const float4 t_in = min(ta, tb), t_out = max(ta, tb);
  const float t0 = max(max(t_in.x, t_in.y), max(t_in.z, tmin));
  const float t1 = min(min(t_out.x, t_out.y), min(t_out.z, tmax));
  if (!(t0 <= t1)) return tmax;

  const float ou = ot.x, ov = ot.y, ow = ot.z, du = dt.x, dv = dt.y, dw = dt.z;
  const int along_u = fabs(du) >= fabs(dv);
  float d_major = along_u ? du : dv;
  const float o_major = along_u ? ou : ov, o_minor = along_u ? ov : ou, d_minor = along_u ? dv : du;
  const int n_major = along_u ? width : height, n_minor = along_u ? height : width;
  const int s_major = along_u ? 1 : width, s_minor = along_u ? width : 1;
  // A ray along w crosses no line within the slab: lean it by less than a thousandth of a texel.
  d_major = copysign(max(fabs(d_major), 1e-8f * fabs(dw)), d_major);
  const float i_major = 1.0f / d_major;
  const int dir = d_major > 0.0f ? 1 : -1;
  const float enter = o_major + d_major * t0;
  int k = clamp((int)(d_major > 0.0f ? floor(enter - 1e-3f) : ceil(enter + 1e-3f)), 0, n_major - 1);
  __global const ushort* p = level->heights + tile->offset;
  const float limit = tile->step_limit;
  const int16 lanes = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  for (;;) {
    const int16 line = k + dir * lanes;
    const float16 t = (convert_float16(line) - o_major) * i_major;
    const float16 minor = o_minor + d_minor * t;
    const int16 y = clamp(convert_int16(minor), (int16)(0), (int16)(n_minor - 2));
    const int16 at = clamp(line, (int16)(0), (int16)(n_major - 1)) * s_major + y * s_minor;
    if (!LANES_IN_BOUNDS(level->bounds, HEIGHTS, tile->offset, at)) return tmax;
    if (!LANES_IN_BOUNDS(level->bounds, HEIGHTS, tile->offset, at + s_minor)) return tmax;
    const float16 h0 = convert_float16(gather16(p, at)), h1 = convert_float16(gather16(p + s_minor, at));
    const float16 rise = h1 - h0;
    const float16 gap = (ow - h0) + dw * t - rise * (minor - convert_float16(y));
    const int16 solid = (h0 > 0.0f) & (h1 > 0.0f) & (fabs(rise) <= limit);
    const float16 D = select((float16)(NAN), gap, solid);
    Segments segment = {t, D, t.s123456789abcdeff, D.s123456789abcdeff};
    const int16 m = max(y, y.s123456789abcdeff);
    const int16 halved =
        is_halved(&segment, fabs(dw * i_major) + NEAR * limit) & (y != y.s123456789abcdeff) & (t < t1);
    if (lane_bits16(halved) & 0x7fffu) {
      const int16 a = clamp(line, (int16)(0), (int16)(n_major - 1)) * s_major + m * s_minor,
                  b = clamp(line + dir, (int16)(0), (int16)(n_major - 1)) * s_major + m * s_minor;
      if (!LANES_IN_BOUNDS(level->bounds, HEIGHTS, tile->offset, a)) return tmax;
      if (!LANES_IN_BOUNDS(level->bounds, HEIGHTS, tile->offset, b)) return tmax;
      const float16 t_row = (convert_float16(m) - o_minor) / d_minor;
      shorten(&segment, halved, t_row, fabs(o_major + d_major * t_row - convert_float16(line)),
              ow + dw * t_row, convert_float16(gather16(p, a)), convert_float16(gather16(p, b)), limit);
    }
    // Between two lines a ray may dip into what it grazes and come out again.
    const int16 grazed = (fabs(D) < GRAZE * limit) & (fabs(D) <= fabs(D.s123456789abcdeff)) &
                         (fabs(D) < fabs(D.s00123456789abcde));
    uint crossed = lane_bits16(((segment.from_D * segment.to_D <= 0.0f) | grazed) & (t < t1)) & 0x7fffu;
    *steps += 1;
    while (crossed) {
      const uint i = lowest_bit(crossed);
      crossed &= crossed - 1u;
      float from_t[16], to_t[16], from_D[16], to_D[16];
      vstore16(segment.from_t, 0, from_t);
      vstore16(segment.to_t, 0, to_t);
      vstore16(segment.from_D, 0, from_D);
      vstore16(segment.to_D, 0, to_D);
      const float length = to_t[i] - from_t[i], slope = (to_D[i] - from_D[i]) / length;
      const int is_crossing = from_D[i] * to_D[i] <= 0.0f;
      float hit = is_crossing ? from_t[i] - from_D[i] / slope : from_t[i];
      const float h = patch_height(level, tile->offset, width, height, ou + du * hit, ov + dv * hit);
      const float again = hit - (ow + dw * hit - h) / slope;
      if (is_crossing && again >= from_t[i] && again <= to_t[i]) hit = again;
      if (hit > tmin && hit < tmax && hit >= t0 - length && hit <= t1 + length &&
          INSIDE(tile, o.x + d.x * hit, o.y + d.y * hit, o.z + d.z * hit))
        return hit;
    }
    k += 15 * dir;
    if (k < 0 || k >= n_major || any_hi(t) >= t1) return tmax;
  }
}

// Puts a child on the stack among those of its node, from `base` on, the farthest lowest.
static inline void push(int* stack, float* stack_t, int* top, int base, int child, float t) {
  int at = (*top)++;
  for (; at > base && stack_t[at - 1] < t; --at) {
    stack_t[at] = stack_t[at - 1];
    stack[at] = stack[at - 1];
  }
  stack_t[at] = t;
  stack[at] = child;
}

#define NODE16_WORDS (7 * 16)

// Nearest hit of a ray in (tmin, tmax): t, and the tile or -1. With `any`, the first that is found.
static inline float trace(const Level* level, float3 o, float3 direction, float tmin, float tmax, int any,
                          int* leaf, uint* steps) {
  const float3 d = (float3)(nonzero(direction.x), nonzero(direction.y), nonzero(direction.z));
  const float3 inv = 1.0f / d, oi = o * inv;
  const int nx = d.x < 0.0f ? 3 : 0, ny = d.y < 0.0f ? 4 : 1, nz = d.z < 0.0f ? 5 : 2;
  int stack[RBVH_STACK];
  float stack_t[RBVH_STACK];
  int top = 0, current = 0;
  float best = tmax;
  *leaf = -1;
  for (;;) {
    while (current >= 0) {
      if (!IN_BOUNDS(level->bounds, NODES, (ulong)current * NODE16_WORDS, NODE16_WORDS)) return best;
      __global const float* b = (__global const float*)(level->nodes + (size_t)current * NODE16_WORDS);
      const float16 ax = vload16(nx, b) * inv.x - oi.x, ay = vload16(ny, b) * inv.y - oi.y,
                    az = vload16(nz, b) * inv.z - oi.z;
      const float16 bx = vload16(3 - nx, b) * inv.x - oi.x, by = vload16(5 - ny, b) * inv.y - oi.y,
                    bz = vload16(7 - nz, b) * inv.z - oi.z;
      const float16 t_in = max(max(ax, ay), max(az, (float16)(tmin)));
      const float16 t_out = min(min(bx, by), min(bz, (float16)(best)));
      *steps += 1;
      uint inside = lane_bits16(t_in <= t_out);
      if (inside == 0) {
        current = INT_MIN;
        break;
      }
      __global const int* child = (__global const int*)(b + 6 * 16);
      uint i = lowest_bit(inside);
      inside &= inside - 1u;
      current = child[i];
      if (inside == 0) continue;
      float t_child[16];
      vstore16(t_in, 0, t_child);
      float t_current = t_child[i];
      const int base = top;
      while (inside) {
        i = lowest_bit(inside);
        inside &= inside - 1u;
        float t = t_child[i];
        int c = child[i];
        if (c == INT_MIN) continue;  // an empty slot, met by a ray without an end
        if (t < t_current) {
          const float swap_t = t_current;
          const int swap_c = current;
          t_current = t;
          current = c;
          t = swap_t;
          c = swap_c;
        }
        push(stack, stack_t, &top, base, c, t);
      }
    }
    if (current != INT_MIN) {
      const float t = march(level, ~current, o, direction, tmin, best, steps);
      if (t < best) {
        best = t;
        *leaf = ~current;
        if (any) return best;
      }
    }
    do {
      if (top == 0) return best;
      --top;
    } while (stack_t[top] > best);
    current = stack[top];
  }
}

__kernel void trace_tile_rays(__global const uint* nodes, __global const Tile* tiles,
                              __global const ushort* heights, __global const RbvhChunk* exact, uint discs,
                              __global const Ray* rays, uint count, uint any, __global Hit* hits,
                              __global uint* steps_out BOUNDS_ARGUMENT) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const Level level = {nodes, tiles, heights, exact, discs BOUNDS_VALUE};
  const float3 o = vload3(0, rays[i].origin), d = vload3(0, rays[i].direction);
  const float tmin = rays[i].tmin, tmax = rays[i].tmax;
  int leaf = -1;
  uint steps = 0;
  float t = INFINITY;
  const float sum = o.x + o.y + o.z + d.x + d.y + d.z;
  if (isfinite(sum) && dot(d, d) > 0.0f && tmin <= tmax)
    t = trace(&level, o, d, tmin, min(tmax, MAXFLOAT), any != 0, &leaf, &steps);
  store_hit(hits + i, &level, o, d, t, leaf);
  if (steps_out) steps_out[i] = steps;
}

// One ray a work-item, 8x8 pixels at a time: for devices that are wide by themselves.
__kernel void trace_tile_pixels(__global const uint* nodes, __global const Tile* tiles,
                                __global const ushort* heights, __global const RbvhChunk* exact, uint discs,
                                CameraRays camera, __global Hit* hits,
                                __global uint* steps_out BOUNDS_ARGUMENT) {
  const uint2 pixel = camera_pixel(camera.width, get_global_id(0));
  if (pixel.x >= camera.width || pixel.y >= camera.height) return;
  const Level level = {nodes, tiles, heights, exact, discs BOUNDS_VALUE};
  const Ray ray = camera_ray(&camera, pixel.x, pixel.y);
  const float3 o = vload3(0, ray.origin), d = vload3(0, ray.direction);
  int leaf = -1;
  uint steps = 0;
  const float t = trace(&level, o, d, 0.0f, MAXFLOAT, 0, &leaf, &steps);
  const size_t at = (size_t)pixel.y * camera.width + pixel.x;
  store_hit(hits + at, &level, o, d, t, leaf);
  if (steps_out) steps_out[at] = steps;
}

// --- sixteen coherent rays
// ------------------------------------------------------------------------------------------

typedef struct {
  float16 dx, dy, dz, t;
  int16 leaf;
} Packet;

static inline void intersect_exact_packet(const Level* level, __global const Tile* tile, int id, float3 o,
                                          Packet* rays, uint* steps) {
  if (!IN_BOUNDS(level->bounds, EXACT, tile->chunk, 1)) return;
  __global const RbvhChunk* c = level->exact + tile->chunk;
  const float from[3] = {o.x, o.y, o.z};
  const float16 along[3] = {rays->dx, rays->dy, rays->dz};
  // Along which no ray is slow.
  const int kz = longest_axis(any_lo(fabs(rays->dx)), any_lo(fabs(rays->dy)), any_lo(fabs(rays->dz)));
  *steps += 1;
  for (uint k = 0; k < RBVH_CHUNK && !isnan(c->shape[0][k]); ++k) {
    const float16 t = intersect_packet(c, k, level->discs, from, along, kz);
    const int16 taken = (t > 0.0f) & (t < rays->t);
    rays->t = select(rays->t, t, taken);
    rays->leaf = select(rays->leaf, (int16)(id), taken);
  }
}

// All sixteen rays march the tile in lockstep, a grid line of its own major axis each.
static inline void march_packet(const Level* level, int id, float3 o, Packet* rays, uint* steps) {
  if (!IN_BOUNDS(level->bounds, TILES, (ulong)id, 1)) return;
  __global const Tile* tile = level->tiles + id;
  if (tile->chunk != RBVH_NO_CHUNK) {
    intersect_exact_packet(level, tile, id, o, rays, steps);
    return;
  }
  __global const float* m = tile->columns;
  const float3 ot = vload3(0, m) * o.x + vload3(1, m) * o.y + vload3(2, m) * o.z + vload3(3, m);
  const float ou = ot.x, ov = ot.y, ow = ot.z;
  const float16 du = m[0] * rays->dx + m[3] * rays->dy + m[6] * rays->dz + 1e-20f,
                dv = m[1] * rays->dx + m[4] * rays->dy + m[7] * rays->dz + 1e-20f,
                dw = m[2] * rays->dx + m[5] * rays->dy + m[8] * rays->dz + 1e-20f;
  const int width = tile->width, height = tile->height;
  const float16 iu = 1.0f / du, iv = 1.0f / dv, iw = 1.0f / dw;
  const float16 ua = -ou * iu, ub = ((float)(width - 1) - ou) * iu;
  const float16 va = -ov * iv, vb = ((float)(height - 1) - ov) * iv;
  const float16 wa = -ow * iw, wb = (tile->top + 1.0f - ow) * iw;
  const float16 t0 = max(max(min(ua, ub), min(va, vb)), max(min(wa, wb), (float16)(0.0f)));
  const float16 t1 = min(min(max(ua, ub), max(va, vb)), min(max(wa, wb), rays->t));
  int16 active = t0 <= t1;
  if (lane_bits16(active) == 0u) return;

  const int16 along_u = fabs(du) >= fabs(dv);
  float16 d_major = select(dv, du, along_u);
  d_major = copysign(max(fabs(d_major), 1e-8f * fabs(dw)), d_major);
  const float16 d_minor = select(du, dv, along_u);
  const float16 o_major = select((float16)(ov), (float16)(ou), along_u),
                o_minor = select((float16)(ou), (float16)(ov), along_u);
  const int16 n_major = select((int16)(height), (int16)(width), along_u) - 1,
              n_minor = select((int16)(width), (int16)(height), along_u) - 2;
  const int16 s_major = select((int16)(width), (int16)(1), along_u),
              s_minor = select((int16)(1), (int16)(width), along_u);
  const float16 i_major = 1.0f / d_major;
  const float16 dir = select((float16)(-1.0f), (float16)(1.0f), d_major > 0.0f);
  const float16 enter = o_major + d_major * t0;
  float16 line = dir * floor(dir * enter - 1e-3f);
  __global const ushort* p = level->heights + tile->offset;
  const float limit = tile->step_limit;
  float16 t = FAR, D = NAN, D_before = NAN;
  int16 y_before = -1;
  // A map to the tile so large that a step is lost in rounding must not keep a ray here.
  for (int left = width + height + 4; left > 0; --left) {
    const float16 t_line = (line - o_major) * i_major;
    const float16 minor = o_minor + d_minor * t_line;
    const int16 y = clamp(convert_int16(minor), 0, n_minor);
    const int16 at = clamp(convert_int16(line), 0, n_major) * s_major + y * s_minor;
    if (!LANES_IN_BOUNDS(level->bounds, HEIGHTS, tile->offset, at)) return;
    if (!LANES_IN_BOUNDS(level->bounds, HEIGHTS, tile->offset, at + s_minor)) return;
    const float16 h0 = convert_float16(gather16(p, at)), h1 = convert_float16(gather16(p, at + s_minor));
    const float16 rise = h1 - h0;
    const float16 gap = (ow - h0) + dw * t_line - rise * (minor - convert_float16(y));
    const int16 solid = (h0 > 0.0f) & (h1 > 0.0f) & (fabs(rise) <= limit);
    const float16 D_line = select((float16)(NAN), gap, solid);
    Segments segment = {t, D, t_line, D_line};
    const int16 halved =
        is_halved(&segment, fabs(dw * i_major) + NEAR * limit) & (y != y_before) & (y_before >= 0) & active;
    if (lane_bits16(halved) != 0u) {
      const int16 row = max(y, y_before) * s_minor;
      const int16 a1 = clamp(convert_int16(line), 0, n_major) * s_major + row,
                  a0 = clamp(convert_int16(line - dir), 0, n_major) * s_major + row;
      if (!LANES_IN_BOUNDS(level->bounds, HEIGHTS, tile->offset, a0)) return;
      if (!LANES_IN_BOUNDS(level->bounds, HEIGHTS, tile->offset, a1)) return;
      const float16 t_row = (convert_float16(max(y, y_before)) - o_minor) / d_minor;
      shorten(&segment, halved, t_row, fabs(o_major + d_major * t_row - (line - dir)), ow + dw * t_row,
              convert_float16(gather16(p, a0)), convert_float16(gather16(p, a1)), limit);
    }
    const int16 crossed = (segment.from_D * segment.to_D <= 0.0f) & active;
    const int16 grazed = ~crossed & active & (fabs(D) < GRAZE * limit) & (fabs(D) <= fabs(D_line)) &
                         (fabs(D) < fabs(D_before));
    *steps += 1;
    if (lane_bits16(crossed | grazed) != 0u) {
      const float16 slope = (segment.to_D - segment.from_D) / (segment.to_t - segment.from_t);
      const float16 secant = segment.from_t - segment.from_D / slope;
      const float16 u = ou + du * secant, v = ov + dv * secant;
      const int16 hx = clamp(convert_int16(u), (int16)(0), (int16)(width - 2)),
                  hy = clamp(convert_int16(v), (int16)(0), (int16)(height - 2));
      const int16 q = hy * width + hx;
      if (!LANES_IN_BOUNDS(level->bounds, HEIGHTS, tile->offset, q)) return;
      if (!LANES_IN_BOUNDS(level->bounds, HEIGHTS, tile->offset, q + width + 1)) return;
      const float16 a = convert_float16(gather16(p, q)), b = convert_float16(gather16(p + 1, q)),
                    c = convert_float16(gather16(p + width, q)),
                    e = convert_float16(gather16(p + width + 1, q));
      const float16 fu = u - convert_float16(hx), fv = v - convert_float16(hy);
      const float16 ha = a + (b - a) * fu, hb = c + (e - c) * fu;
      const int16 whole = (a > 0.0f) & (b > 0.0f) & (c > 0.0f) & (e > 0.0f);
      const float16 newton = secant - (ow + dw * secant - (ha + (hb - ha) * fv)) / slope;
      const float16 met =
          select(secant, newton, whole & (newton >= segment.from_t) & (newton <= segment.to_t));
      const float16 hit = select(met, t, grazed);
      const int16 taken = (crossed | grazed) & (hit > 0.0f) & (hit < rays->t) &
                          INSIDE(tile, o.x + rays->dx * hit, o.y + rays->dy * hit, o.z + rays->dz * hit);
      rays->t = select(rays->t, hit, taken);
      rays->leaf = select(rays->leaf, (int16)(id), taken);
      active &= ~taken;
    }
    active &= t_line < t1;
    if (lane_bits16(active) == 0u) return;
    t = t_line;
    D_before = D;
    D = D_line;
    y_before = y;
    line += dir;
  }
}

#define NODE8_WORDS (7 * 8)

// 4x4 pixels a work-item. A node's eight boxes are tested once for all sixteen rays by interval arithmetic on
// 1/d: the rays share their origin.
__kernel void trace_tile_packets(__global const uint* nodes, __global const Tile* tiles,
                                 __global const ushort* heights, __global const RbvhChunk* exact, uint discs,
                                 CameraRays camera, __global Hit* hits,
                                 __global uint* steps_out BOUNDS_ARGUMENT) {
  const uint g = get_global_id(0), blocks = (camera.width + 3) / 4;
  const uint bx = (g % blocks) * 4, by = (g / blocks) * 4;
  if (by >= camera.height) return;
  const Level level = {nodes, tiles, heights, exact, discs BOUNDS_VALUE};
  const float16 px = (float)bx + camera.offset_x + (float16)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
  const float16 py = (float)by + camera.offset_y + (float16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
  Packet rays;
  rays.dx = camera.corner[0] + camera.right[0] * px + camera.up[0] * py;
  rays.dy = camera.corner[1] + camera.right[1] * px + camera.up[1] * py;
  rays.dz = camera.corner[2] + camera.right[2] * px + camera.up[2] * py;
  const float16 inverse_length = 1.0f / sqrt(rays.dx * rays.dx + rays.dy * rays.dy + rays.dz * rays.dz);
  rays.dx *= inverse_length;
  rays.dy *= inverse_length;
  rays.dz *= inverse_length;
  rays.t = (float16)(FAR);
  rays.leaf = (int16)(-1);
  const float3 o = vload3(0, camera.position);

  // Per axis: the interval of 1/d, or no test at all where the packet's directions differ in sign.
  const float lo[3] = {any_lo(rays.dx), any_lo(rays.dy), any_lo(rays.dz)};
  const float hi[3] = {any_hi(rays.dx), any_hi(rays.dy), any_hi(rays.dz)};
  float inv_lo[3], inv_hi[3];
  int mixed[3], negative[3];
  for (int k = 0; k < 3; ++k) {
    mixed[k] = lo[k] <= 1e-20f && hi[k] >= -1e-20f;
    negative[k] = lo[k] < 0.0f;
    inv_lo[k] = 1.0f / hi[k];
    inv_hi[k] = 1.0f / lo[k];
  }

  int stack[RBVH_STACK];
  float stack_t[RBVH_STACK];
  int top = 0, current = 0;
  float best = FAR;
  uint steps = 0;
  for (;;) {
    if (current >= 0) {
      if (!IN_BOUNDS(level.bounds, NODES, (ulong)current * NODE8_WORDS, NODE8_WORDS)) break;
      __global const float* b = (__global const float*)(level.nodes + (size_t)current * NODE8_WORDS);
      float8 t_in = (float8)(0.0f), t_out = (float8)(best);
      steps += 1;
      for (int k = 0; k < 3; ++k) {
        if (mixed[k]) continue;
        const float origin = k == 0 ? o.x : k == 1 ? o.y : o.z;
        const float8 near = vload8(negative[k] ? k + 3 : k, b) - origin,
                     far = vload8(negative[k] ? k : k + 3, b) - origin;
        t_in = max(t_in, min(near * inv_lo[k], near * inv_hi[k]));
        t_out = min(t_out, max(far * inv_lo[k], far * inv_hi[k]));
      }
      uint inside = lane_bits8(t_in <= t_out);
      if (inside) {
        __global const int* child = (__global const int*)(b + 6 * 8);
        float t_child[8];
        vstore8(t_in, 0, t_child);
        const int base = top;
        while (inside) {
          const uint i = lowest_bit(inside);
          inside &= inside - 1u;
          if (child[i] != INT_MIN) push(stack, stack_t, &top, base, child[i], t_child[i]);
        }
      }
    } else {
      march_packet(&level, ~current, o, &rays, &steps);
      best = any_hi(rays.t);
    }
    do {
      if (top == 0) goto done;
      --top;
    } while (stack_t[top] > best);
    current = stack[top];
  }
done:;
  float dx[16], dy[16], dz[16], t[16];
  int leaf[16];
  vstore16(rays.dx, 0, dx);
  vstore16(rays.dy, 0, dy);
  vstore16(rays.dz, 0, dz);
  vstore16(rays.t, 0, t);
  vstore16(rays.leaf, 0, leaf);
  for (uint i = 0; i < 16; ++i) {
    const uint x = bx + i % 4, y = by + i / 4;
    if (x >= camera.width || y >= camera.height) continue;
    const size_t at = (size_t)y * camera.width + x;
    store_hit(hits + at, &level, o, (float3)(dx[i], dy[i], dz[i]), t[i], leaf[i]);
    if (steps_out) steps_out[at] = steps;
  }
}
