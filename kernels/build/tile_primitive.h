// Triangles and discs in tile space, sampled at texels: how far a texel's centre is from the primitive, and
// how high the primitive's plane is there. Primitives are dilated: they also give heights to texels that they
// do not cover, up to twice the dilation radius from their edge.
#ifndef RBVH_TILE_PRIMITIVE_H
#define RBVH_TILE_PRIMITIVE_H

#include "kernels/build/load3.h"
#include "kernels/build/texel_key.h"

#pragma OPENCL FP_CONTRACT OFF

static inline float4 to_tile(__global const float* m, float4 p) {
  return (float4)(m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
                  m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11], 0.0f);
}

// A primitive at a texel's centre. distance < 0: too far away.
typedef struct {
  float distance;  // texels, at most two dilation radii; 0: it covers the centre
  float w;         // fine quanta
} Sample;

typedef struct {
  float2 a, b, c;
  float scale_ab, scale_bc, scale_ca;  // 1 / edge length: edge values to texels
  float sign;                          // of the projected area
  float w0, wu, wv;                    // plane: w = w0 + wu u + wv v
  float w_lo, w_hi;                    // extrapolation is clamped to these
  int flat;                            // seen edge-on: no plane
} TileTriangle;

static inline float edge_value(float2 p, float2 q, float2 x) {
  return (q.x - p.x) * (x.y - p.y) - (q.y - p.y) * (x.x - p.x);
}

static inline TileTriangle make_triangle(float4 a, float4 b, float4 c, float texel_w) {
  TileTriangle t;
  t.a = a.xy;
  t.b = b.xy;
  t.c = c.xy;
  const float det = edge_value(t.a, t.b, t.c);
  t.sign = det < 0.0f ? -1.0f : 1.0f;
  t.scale_ab = 1.0f / max(length(t.b - t.a), 1e-20f);
  t.scale_bc = 1.0f / max(length(t.c - t.b), 1e-20f);
  t.scale_ca = 1.0f / max(length(t.a - t.c), 1e-20f);
  const float lo = min(a.z, min(b.z, c.z)), hi = max(a.z, max(b.z, c.z));
  t.flat = fabs(det) < 1e-6f || fabs(det) * t.scale_ab * t.scale_bc < 1e-4f;
  if (t.flat) {
    t.w0 = 0.5f * (lo + hi);
    t.wu = t.wv = 0.0f;
  } else {
    const float inv = 1.0f / det;
    t.wu = ((b.z - a.z) * (c.y - a.y) - (c.z - a.z) * (b.y - a.y)) * inv;
    t.wv = ((c.z - a.z) * (b.x - a.x) - (b.z - a.z) * (c.x - a.x)) * inv;
    t.w0 = a.z - t.wu * a.x - t.wv * a.y;
  }
  t.w_lo = lo - texel_w;
  t.w_hi = hi + texel_w;
  return t;
}

// Squared distance of x from the segment from a along ab; `scale`: 1 / |ab|.
static inline float segment_square(float2 a, float2 ab, float scale, float2 x) {
  const float2 away = x - a - ab * clamp(dot(x - a, ab) * scale * scale, 0.0f, 1.0f);
  return dot(away, away);
}

// Separating axes between the triangle and the square of half side `dilation` about x; where they overlap,
// the distance of x from the triangle.
static inline Sample sample_triangle(const TileTriangle* t, float2 x, float dilation) {
  Sample s;
  s.distance = -1.0f;
  s.w = 0.0f;
  const float2 ab = t->b - t->a, bc = t->c - t->b, ca = t->a - t->c;
  const float d0 = t->sign * edge_value(t->a, t->b, x), d1 = t->sign * edge_value(t->b, t->c, x),
              d2 = t->sign * edge_value(t->c, t->a, x);
  if (d0 < -dilation * (fabs(ab.x) + fabs(ab.y)) || d1 < -dilation * (fabs(bc.x) + fabs(bc.y)) ||
      d2 < -dilation * (fabs(ca.x) + fabs(ca.y)))
    return s;
  const float inside = min(d0 * t->scale_ab, min(d1 * t->scale_bc, d2 * t->scale_ca));
  s.distance = 0.0f;
  // Seen edge-on a triangle covers no centre, but must not get lost: it takes the texels right beside it.
  if (inside < 0.0f || t->flat)
    s.distance = clamp(
        sqrt(min(segment_square(t->a, ab, t->scale_ab, x),
                 min(segment_square(t->b, bc, t->scale_bc, x), segment_square(t->c, ca, t->scale_ca, x)))),
        t->flat ? 0.5f : 1e-3f, 2.0f * dilation);
  s.w = clamp(t->w0 + t->wu * x.x + t->wv * x.y, t->w_lo, t->w_hi);
  return s;
}

// Outside, those of the nearest point, but for the error of a sliver.
static inline float3 barycentric(const TileTriangle* t, float2 x) {
  const float inv = t->flat ? 0.0f : 1.0f / edge_value(t->a, t->b, t->c);
  const float3 k = (float3)(clamp(edge_value(t->b, t->c, x) * inv, 0.0f, 1.0f),
                            clamp(edge_value(t->c, t->a, x) * inv, 0.0f, 1.0f),
                            clamp(edge_value(t->a, t->b, x) * inv, 0.0f, 1.0f));
  return t->flat ? (float3)(1.0f / 3) : k / (k.x + k.y + k.z);
}

// Its plane is w = center.z - slope . (x - center); lengths in texels.
typedef struct {
  float4 center;
  float2 slope;
  float radius;    // texels
  float w_texels;  // fine quanta to texels
  int flat, is_back;
} TileDisc;

static inline TileDisc make_disc(__global const RasterTile* tile, __global const float* s) {
  TileDisc d;
  __global const float* m = tile->to_tile;
  d.center = to_tile(m, load3(s, 0));
  const float4 n = (float4)(s[4], s[5], s[6], 0.0f);
  const float4 ru = (float4)(m[0], m[1], m[2], 0.0f), rv = (float4)(m[4], m[5], m[6], 0.0f),
               rw = (float4)(m[8], m[9], m[10], 0.0f);
  const float per_texel = length(ru);
  d.radius = s[3] * per_texel;
  d.w_texels = 1.0f / tile->texel_w;
  // A step of one texel is ru / |ru|^2, one fine quantum rw / |rw|^2.
  const float nw = dot(n, rw) / dot(rw, rw);
  d.is_back = nw < 0.0f;
  d.flat = fabs(nw) * length(rw) < 0.1f;  // steeper than 84 degrees
  d.slope = d.flat ? (float2)(0.0f) : (float2)(dot(n, ru) / dot(ru, ru), dot(n, rv) / dot(rv, rv)) / nw;
  return d;
}

// The distance is from the disc's edge, along its plane.
static inline Sample sample_disc(const TileDisc* d, float2 x, float dilation) {
  Sample s;
  const float2 step = x - d->center.xy;
  const float rise = -dot(d->slope, step);
  const float away = sqrt(dot(step, step) + rise * rise * d->w_texels * d->w_texels) - d->radius;
  s.w = d->center.z + rise;
  s.distance = away > 1.42f * dilation ? -1.0f : max(away, d->flat ? 0.5f : 0.0f);
  return s;
}

// Either of them, and the texels within its dilated extent.
typedef struct {
  TileTriangle triangle;
  TileDisc disc;
  int x0, x1, y0, y1;
  float2 lo, hi;  // its extent in the plane, not dilated
  int is_disc, is_back, flat;
  float steep;  // its area in texels, where it is too steep on the tile to be shown by it; else 0
} TilePrimitive;

static inline TilePrimitive make_primitive(__global const RasterTile* tile, __global const float* s,
                                           uint is_disc, float dilation) {
  TilePrimitive p;
  float2 lo, hi;
  p.is_disc = is_disc != 0;
  if (is_disc) {
    p.disc = make_disc(tile, s);
    lo = p.disc.center.xy - p.disc.radius;
    hi = p.disc.center.xy + p.disc.radius;
    p.is_back = p.disc.is_back;
    p.flat = p.disc.flat;
    p.steep = 0.0f;
  } else {
    const float4 a = to_tile(tile->to_tile, load3(s, 0)), b = to_tile(tile->to_tile, load3(s, 1)),
                 c = to_tile(tile->to_tile, load3(s, 2));
    p.triangle = make_triangle(a, b, c, tile->texel_w);
    lo = min(a.xy, min(b.xy, c.xy));
    hi = max(a.xy, max(b.xy, c.xy));
    p.is_back = p.triangle.sign < 0.0f;
    p.flat = p.triangle.flat;
    const float4 unit = (float4)(1.0f, 1.0f, 1.0f / tile->texel_w, 0.0f);
    const float4 n = cross((b - a) * unit, (c - a) * unit);
    p.steep = fabs(n.z) < RBVH_STEEP_COSINE * length(n) ? 0.5f * length(n) : 0.0f;
  }
  p.lo = lo;
  p.hi = hi;
  p.x0 = max(0, (int)ceil(lo.x - dilation));
  p.x1 = min((int)tile->width - 1, (int)floor(hi.x + dilation));
  p.y0 = max(0, (int)ceil(lo.y - dilation));
  p.y1 = min((int)tile->height - 1, (int)floor(hi.y + dilation));
  return p;
}

#define FOR_EACH_TEXEL(p)                \
  for (int y = (p).y0; y <= (p).y1; ++y) \
    for (int x = (p).x0; x <= (p).x1; ++x)

// Whether its extent comes near enough to the texel to beat or equal `key`: cheaper than to sample it.
static inline bool may_win(const TilePrimitive* p, int x, int y, uint key, float rank_dilation) {
  const float2 at = (float2)((float)x, (float)y), away = max(max(p->lo - at, at - p->hi), 0.0f);
  return rank_of(max(away.x, away.y), rank_dilation) >= key_rank(key);
}

static inline Sample sample_primitive(const TilePrimitive* p, int x, int y, float dilation) {
  const float2 at = (float2)((float)x, (float)y);
  return p->is_disc ? sample_disc(&p->disc, at, dilation) : sample_triangle(&p->triangle, at, dilation);
}

#endif
