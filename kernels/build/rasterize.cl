// Tiles: finds each tile's rectangle, rasterises its primitives into height texels, and sums up what came
// out. A texel's key orders candidates in one 32-bit atomic maximum, so the result does not depend on their
// order:
//   bits 24..31  255: the primitive covers the texel's centre; below: how near it comes (254 near .. 1 far);
//   0: nothing,
//                or, with a height, a texel where only neighbouring tiles may have something to say
//   bits 0..23   height in fine quanta (the nearest surface along the tile's normal wins)
#include "kernels/common/layout.h"

#pragma OPENCL FP_CONTRACT OFF

static inline float4 load3(__global const float* p, uint i) {
  return (float4)(p[3 * i], p[3 * i + 1], p[3 * i + 2], 0.0f);
}

// --- the rectangle
// --------------------------------------------------------------------------------------------------

// cos and sin of RBVH_FRAME_ANGLES angles in [0, 90) degrees.
__constant float frame_cos[16] = {
    1.0f,        0.99518473f, 0.98078528f, 0.95694034f, 0.92387953f, 0.88192126f, 0.83146961f, 0.77301045f,
    0.70710678f, 0.63439328f, 0.55557023f, 0.47139674f, 0.38268343f, 0.29028468f, 0.19509032f, 0.09801714f};
__constant float frame_sin[16] = {
    0.0f,        0.09801714f, 0.19509032f, 0.29028468f, 0.38268343f, 0.47139674f, 0.55557023f, 0.63439328f,
    0.70710678f, 0.77301045f, 0.83146961f, 0.88192126f, 0.92387953f, 0.95694034f, 0.98078528f, 0.99518473f};

typedef struct {
  float16 u_lo, u_hi, v_lo, v_hi;
  float w_lo, w_hi;
} Extents;

static inline void extents_add(Extents* e, float u, float v, float w, float reach_uv, float reach_w) {
  const float16 c = vload16(0, frame_cos), s = vload16(0, frame_sin);
  const float16 ru = c * u + s * v, rv = c * v - s * u;
  e->u_lo = min(e->u_lo, ru - reach_uv);
  e->u_hi = max(e->u_hi, ru + reach_uv);
  e->v_lo = min(e->v_lo, rv - reach_uv);
  e->v_hi = max(e->v_hi, rv + reach_uv);
  e->w_lo = min(e->w_lo, w - reach_w);
  e->w_hi = max(e->w_hi, w + reach_w);
}

__kernel void rasterize_extents(__global const Run* runs, uint run_count, __global const TileAxes* axes,
                                __global const uint* references, __global const float* shape, uint is_disc,
                                __global TileExtents* extents) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  __global const TileAxes* a = axes + runs[r].owner;
  const float4 o = vload4(0, a->origin), u = vload4(0, a->u), v = vload4(0, a->v), w = vload4(0, a->w);
  Extents e;
  e.u_lo = e.v_lo = (float16)(FLT_MAX);
  e.u_hi = e.v_hi = (float16)(-FLT_MAX);
  e.w_lo = FLT_MAX;
  e.w_hi = -FLT_MAX;
  for (uint i = runs[r].begin; i < end; ++i) {
    __global const float* s = shape + 9 * (size_t)references[i];
    if (is_disc) {
      const float4 p = load3(s, 0) - o;
      const float lean = dot((float4)(s[4], s[5], s[6], 0.0f), w);
      extents_add(&e, dot(p, u), dot(p, v), dot(p, w), s[3], s[3] * sqrt(max(0.0f, 1.0f - lean * lean)));
    } else {
      for (uint k = 0; k < 3; ++k) {
        const float4 p = load3(s, k) - o;
        extents_add(&e, dot(p, u), dot(p, v), dot(p, w), 0.0f, 0.0f);
      }
    }
  }
  __global TileExtents* out = extents + r;
  vstore16(e.u_lo, 0, out->u_lo);
  vstore16(e.u_hi, 0, out->u_hi);
  vstore16(e.v_lo, 0, out->v_lo);
  vstore16(e.v_hi, 0, out->v_hi);
  out->w_lo = e.w_lo;
  out->w_hi = e.w_hi;
}

// --- heights
// --------------------------------------------------------------------------------------------------------

static inline float4 to_tile(__global const float* m, float4 p) {
  return (float4)(m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
                  m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11], 0.0f);
}

// `distance` in texels; 0: covered.
static inline uint rank_of(float distance, float reach) {
  return distance <= 0.0f ? 255u : (uint)(254.0f - distance * (126.5f / reach));
}

static inline uint make_key(float distance, float reach, float w) {
  return (rank_of(distance, reach) << 24) | (uint)clamp(w, 0.0f, RBVH_FINE_MAX);
}

// What a primitive has to say of one texel. distance < 0: nothing.
typedef struct {
  float distance;  // texels, capped at 2 reach; 0 where it covers the centre
  float w;
} Sample;

// A triangle in tile space, ready to be asked.
typedef struct {
  float2 a, b, c;
  float scale_ab, scale_bc, scale_ca;  // 1 / edge length: edge values to texels
  float sign;                          // of the projected area
  float w0, wu, wv;                    // plane: w = w0 + wu u + wv v
  float w_lo, w_hi;                    // where extrapolation stops
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

// Square of the distance of x from the segment from a along ab; `scale`: 1 / |ab|.
static inline float segment_square(float2 a, float2 ab, float scale, float2 x) {
  const float2 away = x - a - ab * clamp(dot(x - a, ab) * scale * scale, 0.0f, 1.0f);
  return dot(away, away);
}

// Does the square of half side `reach` about x touch the triangle (separating axes)? If so, how far is x from
// it?
static inline Sample sample_triangle(const TileTriangle* t, float2 x, float reach) {
  Sample s;
  s.distance = -1.0f;
  s.w = 0.0f;
  const float2 ab = t->b - t->a, bc = t->c - t->b, ca = t->a - t->c;
  const float d0 = t->sign * edge_value(t->a, t->b, x), d1 = t->sign * edge_value(t->b, t->c, x),
              d2 = t->sign * edge_value(t->c, t->a, x);
  if (d0 < -reach * (fabs(ab.x) + fabs(ab.y)) || d1 < -reach * (fabs(bc.x) + fabs(bc.y)) ||
      d2 < -reach * (fabs(ca.x) + fabs(ca.y)))
    return s;
  const float inside = min(d0 * t->scale_ab, min(d1 * t->scale_bc, d2 * t->scale_ca));
  s.distance = 0.0f;
  // Seen edge-on it covers nothing, but must leave a trace: the texels right beside it.
  if (inside < 0.0f || t->flat)
    s.distance = clamp(
        sqrt(min(segment_square(t->a, ab, t->scale_ab, x),
                 min(segment_square(t->b, bc, t->scale_bc, x), segment_square(t->c, ca, t->scale_ca, x)))),
        t->flat ? 0.5f : 1e-3f, 2.0f * reach);
  s.w = clamp(t->w0 + t->wu * x.x + t->wv * x.y, t->w_lo, t->w_hi);
  return s;
}

// Outside, those of the nearest point but for a sliver's error.
static inline float3 barycentric(const TileTriangle* t, float2 x) {
  const float inv = t->flat ? 0.0f : 1.0f / edge_value(t->a, t->b, t->c);
  const float3 k = (float3)(clamp(edge_value(t->b, t->c, x) * inv, 0.0f, 1.0f),
                            clamp(edge_value(t->c, t->a, x) * inv, 0.0f, 1.0f),
                            clamp(edge_value(t->a, t->b, x) * inv, 0.0f, 1.0f));
  return t->flat ? (float3)(1.0f / 3) : k / (k.x + k.y + k.z);
}

// A disc in tile space: its plane as w = center.z - lean . (x - center), and lengths in texels.
typedef struct {
  float4 center;
  float2 lean;
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
  d.lean = d.flat ? (float2)(0.0f) : (float2)(dot(n, ru) / dot(ru, ru), dot(n, rv) / dot(rv, rv)) / nw;
  return d;
}

// The distance is from the rim, along the disc's plane.
static inline Sample sample_disc(const TileDisc* d, float2 x, float reach) {
  Sample s;
  const float2 step = x - d->center.xy;
  const float rise = -dot(d->lean, step);
  const float away = sqrt(dot(step, step) + rise * rise * d->w_texels * d->w_texels);
  s.w = d->center.z + rise;
  s.distance = away <= d->radius                   ? 0.0f
               : away <= d->radius + 1.42f * reach ? reach * (1.0f + (away - d->radius) / (1.42f * reach))
                                                   : -1.0f;
  if (d->flat && s.distance >= 0.0f) s.distance = 2.0f * reach;
  return s;
}

// Either of them, and the texels that it may have a say on.
typedef struct {
  TileTriangle triangle;
  TileDisc disc;
  int x0, x1, y0, y1;
  float2 lo, hi;  // its extent in the plane
  int is_disc, is_back, flat;
  float steep;  // its area in texels, if it stands too steep on the tile to be shown there
} TilePrimitive;

static inline TilePrimitive make_primitive(__global const RasterTile* tile, __global const float* s,
                                           uint is_disc, float reach) {
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
  p.x0 = max(0, (int)ceil(lo.x - reach));
  p.x1 = min((int)tile->width - 1, (int)floor(hi.x + reach));
  p.y0 = max(0, (int)ceil(lo.y - reach));
  p.y1 = min((int)tile->height - 1, (int)floor(hi.y + reach));
  return p;
}

#define FOR_EACH_TEXEL(p)                \
  for (int y = (p).y0; y <= (p).y1; ++y) \
    for (int x = (p).x0; x <= (p).x1; ++x)

// Might it come as near to the texel as `key` does? What has nothing new to say need not be asked.
static inline bool may_speak(const TilePrimitive* p, int x, int y, uint key, float reach) {
  const float2 at = (float2)((float)x, (float)y), away = max(max(p->lo - at, at - p->hi), 0.0f);
  return rank_of(max(away.x, away.y), reach) >= key >> 24;
}

static inline Sample sample_primitive(const TilePrimitive* p, int x, int y, float reach) {
  const float2 at = (float2)((float)x, (float)y);
  return p->is_disc ? sample_disc(&p->disc, at, reach) : sample_triangle(&p->triangle, at, reach);
}

static inline uint fine(float w) { return (uint)clamp(w, 0.0f, RBVH_FINE_MAX); }

// An atomic maximum that first looks whether it is worth one: most are not.
static inline void raise(volatile __global uint* p, uint value) {
  if (*p < value) atomic_max(p, value);
}

// keys: the winner. lowest, highest: what covers the texel's centre, to see two layers; kept as
// RBVH_FINE_MAX - w and w, each plus one, 0: nothing.
__kernel void rasterize(__global const Run* runs, uint run_count, __global const RasterTile* tiles,
                        __global const uint* references, __global const float* shape, uint is_disc,
                        float own_reach, float reach, __global uint* keys, __global uint* lowest,
                        __global uint* highest, __global TileFaults* faults) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  __global const RasterTile* tile = tiles + runs[r].owner;
  uint back = 0;
  float steep = 0.0f;
  for (uint i = runs[r].begin; i < end; ++i) {
    const TilePrimitive p = make_primitive(tile, shape + 9 * (size_t)references[i], is_disc, own_reach);
    steep += p.steep;
    FOR_EACH_TEXEL(p) {
      const uint at = tile->offset + (uint)y * tile->width + (uint)x;
      if (!may_speak(&p, x, y, keys[at], reach)) continue;
      const Sample q = sample_primitive(&p, x, y, own_reach);
      if (q.distance < 0.0f) continue;
      raise(keys + at, make_key(q.distance, reach, q.w));
      if (q.distance != 0.0f) continue;
      raise(lowest + at, (uint)RBVH_FINE_MAX - fine(q.w) + 1u);
      raise(highest + at, fine(q.w) + 1u);
      back += p.is_back;
    }
  }
  if (back != 0) atomic_add(&faults[runs[r].owner].backs, back);
  if (steep != 0.0f) atomic_add(&faults[runs[r].owner].steep, (uint)min(steep * 16.0f, 1e6f));
}

// --- the rim
// --------------------------------------------------------------------------------------------------------

// The texels around those that a tile's primitives reach are open to its neighbours, about the height of the
// nearest own.
__kernel void rasterize_widen(__global const RasterTile* tiles, uint tile_count, __global uint* keys) {
  const uint k = get_global_id(0);
  if (k >= tile_count) return;
  const RasterTile tile = tiles[k];
  for (uint y = 0; y < tile.height; ++y)
    for (uint x = 0; x < tile.width; ++x) {
      const uint at = tile.offset + y * tile.width + x;
      if (keys[at] != 0) continue;
      uint best = 0;
      for (uint v = max(y, 1u) - 1; v <= min(y + 1, tile.height - 1); ++v)
        for (uint u = max(x, 1u) - 1; u <= min(x + 1, tile.width - 1); ++u)
          best = max(best, keys[tile.offset + v * tile.width + u]);
      if (best >> 24 != 0) keys[at] = max(best & 0xffffffu, 1u);
    }
}

// What the neighbouring tiles' primitives have to say of the texels that this tile's own reach: the same
// surface within `gap` texels of its own is a candidate like its own; anything else there only says that the
// surface goes on (1). What touches the surface's rim says nothing of what is farther from it than
// `boundary_reach`, unless it turns away there.
__kernel void rasterize_overlaps(__global const Run* runs, uint run_count, __global const RasterTile* tiles,
                                 __global const uint* overlaps, __global const float* shape,
                                 __global const float4* area_normal, float boundary_reach, float reach,
                                 float gap, __global const uint* keys, __global uint* overlap_keys) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  __global const RasterTile* tile = tiles + runs[r].owner;
  for (uint i = runs[r].begin; i < end; ++i) {
    const TilePrimitive p = make_primitive(tile, shape + 9 * (size_t)overlaps[i], 0u, reach);
    const bool faces = !p.is_back && !p.flat && p.steep == 0.0f;
    const float here = faces && area_normal[overlaps[i]].w != 0.0f ? boundary_reach : 2.0f * reach;
    FOR_EACH_TEXEL(p) {
      const uint at = tile->offset + (uint)y * tile->width + (uint)x;
      if (keys[at] == 0 || !may_speak(&p, x, y, overlap_keys[at], reach)) continue;
      if (keys[at] >> 24 == 255u && !may_speak(&p, x, y, keys[at], reach)) continue;
      const Sample q = sample_primitive(&p, x, y, reach);
      if (q.distance < 0.0f || q.distance > here) continue;
      const float own = (float)(keys[at] & 0xffffffu);
      const bool same = faces && fabs(q.w - own) <= gap * tile->texel_w;
      raise(overlap_keys + at, same ? make_key(q.distance, reach, q.w) : 1u);
    }
  }
}

// A guest takes a texel that it is nearer to. Where nobody covers a texel's centre the surface turns away or
// ends, and the tile reaches less far; but no tile is lost for falling between the texels, none of which is
// farther off than 0.71.
__kernel void rasterize_merge(__global const RasterTile* tiles, uint tile_count, __global uint* keys,
                              __global const uint* overlap_keys, float reach, float turn_reach,
                              float open_reach) {
  const uint k = get_global_id(0);
  if (k >= tile_count) return;
  const uint begin = tiles[k].offset, end = begin + tiles[k].width * tiles[k].height;
  uint highest = 0;
  for (uint at = begin; at < end; ++at) highest = max(highest, keys[at]);
  const uint all = highest < make_key(0.0f, reach, 0.0f) ? make_key(0.75f, reach, 0.0f) : UINT_MAX;
  const uint turn = min(all, make_key(turn_reach, reach, 0.0f)),
             open = min(all, make_key(open_reach, reach, 0.0f));
  for (uint at = begin; at < end; ++at) {
    const uint own = keys[at], overlap = overlap_keys[at];
    const uint key = own >> 24 < overlap >> 24 ? overlap : own;
    keys[at] = key < (overlap == 0 ? open : turn) ? 0 : key;
  }
}

// --- signals on the surface
// -----------------------------------------------------------------------------------------

// Octahedral unit normal, 8 bits a coordinate, and 5-6-5 colour, as the file has them.
static inline uint pack_normal(float4 n) {
  const float sum = fabs(n.x) + fabs(n.y) + fabs(n.z);
  if (!(sum > 0.0f)) return 0x8080u;
  float2 p = n.xy / sum;
  if (n.z < 0.0f) p = (1.0f - fabs(p.yx)) * (float2)(n.x < 0.0f ? -1.0f : 1.0f, n.y < 0.0f ? -1.0f : 1.0f);
  const float2 q = clamp(floor(p * 127.0f + 128.5f), 1.0f, 255.0f);
  return (uint)q.x | ((uint)q.y << 8);
}

static inline uint pack_color(float4 c) {
  const float4 q = clamp(floor(c * (float4)(31.0f, 63.0f, 31.0f, 0.0f) / 255.0f + 0.5f), 0.0f, 63.0f);
  return ((uint)q.x << 11) | ((uint)q.y << 5) | (uint)q.z;
}

static inline float4 color_of(__global const uint* colors, uint i) {
  const uint c = colors[i];
  return (float4)((float)(c & 255u), (float)((c >> 8) & 255u), (float)((c >> 16) & 255u), 0.0f);
}

// The same primitives again: those whose key won give the texel their normal (and colour), interpolated at
// its centre. Of equal keys the largest value wins, so the order does not matter here either.
__kernel void rasterize_signals(__global const Run* runs, uint run_count, __global const RasterTile* tiles,
                                __global const uint* references, __global const float* shape, uint is_disc,
                                float own_reach, float reach, __global const uint* keys,
                                __global const uint* order, __global const uint* indices,
                                __global const float* normals, __global const uint* colors, uint has_colors,
                                __global uint* texel_normals, __global uint* texel_colors) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  __global const RasterTile* tile = tiles + runs[r].owner;
  for (uint i = runs[r].begin; i < end; ++i) {
    const uint j = references[i];
    const TilePrimitive p = make_primitive(tile, shape + 9 * (size_t)j, is_disc, own_reach);
    FOR_EACH_TEXEL(p) {
      const uint at = tile->offset + (uint)y * tile->width + (uint)x;
      if (keys[at] == 0 || !may_speak(&p, x, y, keys[at], reach)) continue;
      const Sample q = sample_primitive(&p, x, y, own_reach);
      if (q.distance < 0.0f || make_key(q.distance, reach, q.w) != keys[at]) continue;
      if (is_disc) {
        raise(texel_normals + at, pack_normal(load3(normals, order[j])));
        if (has_colors) raise(texel_colors + at, 0x10000u | pack_color(color_of(colors, order[j])));
        continue;
      }
      __global const uint* corner = indices + 3 * (size_t)order[j];
      const float3 k = barycentric(&p.triangle, (float2)((float)x, (float)y));
      raise(texel_normals + at,
            pack_normal(load3(normals, corner[0]) * k.x + load3(normals, corner[1]) * k.y +
                        load3(normals, corner[2]) * k.z));
      if (has_colors)
        raise(texel_colors + at,
              0x10000u | pack_color(color_of(colors, corner[0]) * k.x + color_of(colors, corner[1]) * k.y +
                                    color_of(colors, corner[2]) * k.z));
    }
  }
}

// --- what came out
// --------------------------------------------------------------------------------------------------

// What else a tile alone shows of itself, before it looks at its neighbours. `layer_gap`, `step_limit`: in
// texels.
__kernel void rasterize_faults(__global const RasterTile* tiles, uint tile_count, __global const uint* keys,
                               __global const uint* lowest, __global const uint* highest, float layer_gap,
                               float step_limit, __global TileFaults* faults) {
  const uint k = get_global_id(0);
  if (k >= tile_count) return;
  const RasterTile tile = tiles[k];
  uint layered = 0, steps = 0;
  const float gap = layer_gap * tile.texel_w, step = step_limit * tile.texel_w;
  for (uint y = 0; y < tile.height; ++y)
    for (uint x = 0; x < tile.width; ++x) {
      const uint at = tile.offset + y * tile.width + x;
      const uint key = keys[at];
      if (key == 0) continue;
      const float w = (float)(key & 0xffffffu);
      if (highest[at] != 0 && (float)(highest[at] - 1u) - (RBVH_FINE_MAX - (float)(lowest[at] - 1u)) > gap)
        layered++;
      const uint right = x + 1 < tile.width ? keys[at + 1] : 0,
                 below = y + 1 < tile.height ? keys[at + tile.width] : 0;
      if (right != 0 && fabs((float)(right & 0xffffffu) - w) > step) steps++;
      if (below != 0 && fabs((float)(below & 0xffffffu) - w) > step) steps++;
    }
  faults[k].layered = layered;
  faults[k].steps = steps;
}

// Triangles' corners further than `miss_limit` texels from the heights that the march would find there.
__kernel void rasterize_misses(__global const Run* runs, uint run_count, __global const RasterTile* tiles,
                               __global const uint* references, __global const float* shape, float miss_limit,
                               __global const uint* keys, __global TileFaults* faults) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  __global const RasterTile* tile = tiles + runs[r].owner;
  const float limit = miss_limit * tile->texel_w;
  uint misses = 0;
  for (uint i = runs[r].begin; i < end; ++i)
    for (uint k = 0; k < 3; ++k) {
      const float4 p = to_tile(tile->to_tile, load3(shape + 9 * (size_t)references[i], k));
      const uint x = min((uint)max(p.x, 0.0f), tile->width - 2),
                 y = min((uint)max(p.y, 0.0f), tile->height - 2);
      __global const uint* q = keys + tile->offset + y * tile->width + x;
      const uint a = q[0], b = q[1], c = q[tile->width], d = q[tile->width + 1];
      if (a == 0 || b == 0 || c == 0 || d == 0) continue;
      const float fu = p.x - (float)x, fv = p.y - (float)y;
      const float h0 = mix((float)(a & 0xffffffu), (float)(b & 0xffffffu), fu),
                  h1 = mix((float)(c & 0xffffffu), (float)(d & 0xffffffu), fu);
      misses += fabs(mix(h0, h1, fv) - p.z) > limit;
    }
  if (misses != 0) atomic_add(&faults[runs[r].owner].misses, misses);
}

// Triangles that reach further than `slack` texels into a cell with an empty corner, where no march finds
// them: their places among `references`, in no order. `list`[0] counts them; those beyond its `room` are left
// out.
__kernel void rasterize_uncovered(__global const Run* runs, uint run_count, __global const RasterTile* tiles,
                                  __global const uint* references, __global const float* shape, float slack,
                                  __global const uint* keys, uint room, __global uint* list) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  __global const RasterTile* tile = tiles + runs[r].owner;
  for (uint i = runs[r].begin; i < end; ++i) {
    const TilePrimitive p = make_primitive(tile, shape + 9 * (size_t)references[i], 0, 0.0f);
    const uint x1 = min(tile->width - 2, (uint)p.hi.x), y1 = min(tile->height - 2, (uint)p.hi.y);
    bool is_uncovered = false;
    for (uint y = (uint)max(p.lo.y, 0.0f); y <= y1; ++y)
      for (uint x = (uint)max(p.lo.x, 0.0f); x <= x1; ++x) {
        __global const uint* q = keys + tile->offset + y * tile->width + x;
        if (q[0] != 0 && q[1] != 0 && q[tile->width] != 0 && q[tile->width + 1] != 0) continue;
        const float2 middle = (float2)((float)x + 0.5f, (float)y + 0.5f);
        is_uncovered |= sample_triangle(&p.triangle, middle, 0.5f - slack).distance >= 0.0f;
      }
    if (!is_uncovered) continue;
    const uint at = atomic_inc(list);
    if (at < room) list[1 + at] = i;
  }
}

__kernel void rasterize_range(__global const RasterTile* tiles, uint tile_count, __global const uint* keys,
                              __global TileRange* ranges) {
  const uint k = get_global_id(0);
  if (k >= tile_count) return;
  const uint begin = tiles[k].offset, end = begin + tiles[k].width * tiles[k].height;
  TileRange range;
  range.lo = 0xffffffffu;
  range.hi = range.used = 0;
  for (uint at = begin; at < end; ++at) {
    const uint key = keys[at];
    if (key == 0) continue;
    const uint w = key & 0xffffffu;
    range.lo = min(range.lo, w);
    range.hi = max(range.hi, w);
    range.used++;
  }
  ranges[k] = range;
}

// Heights in 16-bit quanta over the tile's own range: 1 + round((w - lo) * 65534 / range); 0: no surface.
__kernel void rasterize_quantize(__global const RasterTile* tiles, uint tile_count,
                                 __global const uint* bases, __global const float* scales,
                                 __global const uint* keys, __global ushort* heights) {
  const uint k = get_global_id(0);
  if (k >= tile_count) return;
  const uint begin = tiles[k].offset, end = begin + tiles[k].width * tiles[k].height;
  for (uint at = begin; at < end; ++at) {
    const uint key = keys[at];
    heights[at] = key == 0 ? 0 : (ushort)(1.5f + ((float)((key & 0xffffffu) - bases[k])) * scales[k]);
  }
}
