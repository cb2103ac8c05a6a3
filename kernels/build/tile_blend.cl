// A cloud's discs overlap, and where they do each has a height of its own: a tile that showed the topmost one
// would look like scales. As in surface splatting they are blended, by weights that fall to zero at the end
// of a disc's support (Zwicker et al., "Surface Splatting", SIGGRAPH 2001; Botsch and Kobbelt, "High-Quality
// Point-Based Rendering on Modern GPUs", Pacific Graphics 2003).
//
// A disc is a plane tangent to the surface, which bends away from it: at distance d from the centre by half
// the curvature times d^2. On the chord, whose slope is the mean of those at both of its ends, that error
// cancels (the trapezoidal rule). So disc i says that the height at x, at d = x - c_i from its centre, is
//   h_i(x) = z_i + (g_i + g(x)) . d / 2,
// with its slope g_i and the blended slope g(x), and the texel's height is the weighted mean of the h_i.
#include "kernels/build/pack_signals.h"
#include "kernels/build/tile_primitive.h"

#pragma OPENCL FP_CONTRACT OFF

// Sums of a texel over discs: weights; weighted heights z_i + g_i . d / 2 above the texel's own height, in
// texels; weighted d; weighted unit normals along the tile's axes; weights of colours, and weighted colours.
#define WEIGHT 0
#define HEIGHT 1
#define AWAY 2
#define NORMAL 4
#define COLOR_WEIGHT 7
#define COLOR 8
#define SUMS 11

// The part of a weight that counts where no other disc does.
#define LAST 1e-3f

// (1 - t)^2 for a squared distance of t supports.
static inline float falloff(float t) { return t < 1.0f ? (1.0f - t) * (1.0f - t) : 0.0f; }

// The tile's axes, unit vectors.
typedef struct {
  float4 u, v, w;
} TileFrame;

static inline TileFrame make_frame(__global const float* m) {
  TileFrame f;
  f.u = normalize((float4)(m[0], m[1], m[2], 0.0f));
  f.v = normalize((float4)(m[4], m[5], m[6], 0.0f));
  f.w = normalize((float4)(m[8], m[9], m[10], 0.0f));
  return f;
}

// Adds a disc to the texels that its support reaches and whose surface, at most `gap` texels off, is its own.
// `reach`: the support in radii; at least `filter` texels beyond the disc, so that no detail is finer than
// the texels.
static inline void add_disc(__global const RasterTile* tile, const TileFrame* frame, __global const float* s,
                            float reach, float filter, float gap, uint color, __global const uint* keys,
                            __global float* sums) {
  const TileDisc d = make_disc(tile, s);
  const float4 n = (float4)(s[4], s[5], s[6], 0.0f);
  const float3 normal = (float3)(dot(n, frame->u), dot(n, frame->v), dot(n, frame->w));
  const float support = max(reach * d.radius, d.radius + filter), color_support = max(d.radius, filter);
  const float facing = d.is_back || d.flat ? LAST : normal.z * normal.z;
  const float2 slope = -d.slope * d.w_texels;
  const int x0 = max(0, (int)ceil(d.center.x - support)),
            x1 = min((int)tile->width - 1, (int)floor(d.center.x + support)),
            y0 = max(0, (int)ceil(d.center.y - support)),
            y1 = min((int)tile->height - 1, (int)floor(d.center.y + support));
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x) {
      const uint at = (uint)y * tile->width + (uint)x;
      if (keys[at] == 0) continue;
      const float2 away = (float2)((float)x, (float)y) - d.center.xy;
      const float rise = dot(slope, away), squared = dot(away, away) + rise * rise;
      const float weight = facing * falloff(squared / (support * support));
      if (weight == 0.0f) continue;
      const float above = (d.center.z - (float)key_height(keys[at])) * d.w_texels;
      if (fabs(above + rise) > gap) continue;
      __global float* sum = sums + SUMS * (size_t)at;
      sum[WEIGHT] += weight;
      sum[HEIGHT] += weight * (above + 0.5f * rise);
      sum[AWAY] += weight * away.x;
      sum[AWAY + 1] += weight * away.y;
      sum[NORMAL] += weight * normal.x;
      sum[NORMAL + 1] += weight * normal.y;
      sum[NORMAL + 2] += weight * normal.z;
      // Colours are no noisier than they look: they are blended over the disc itself.
      const float tint = facing * falloff(squared / (color_support * color_support)) + LAST * weight;
      const float4 c = unpack_color(color) * tint;
      sum[COLOR_WEIGHT] += tint;
      sum[COLOR] += c.x;
      sum[COLOR + 1] += c.y;
      sum[COLOR + 2] += c.z;
    }
}

// discs[firsts[k], firsts[k + 1]): those of tile k and of its overlapping neighbours, in the order in which
// they are added. `sums`: zeros. The heights in the keys become the blended ones.
__kernel void tile_blend(__global const RasterTile* tiles, uint tile_count, __global const uint* firsts,
                         __global const uint* discs, __global const float* shape, __global const float* reach,
                         __global const uint* order, __global const uint* colors, uint has_colors,
                         float filter, float gap, __global float* sums, __global uint* keys,
                         __global uint* texel_normals, __global uint* texel_colors) {
  const uint k = get_global_id(0);
  if (k >= tile_count) return;
  __global const RasterTile* tile = tiles + k;
  const TileFrame frame = make_frame(tile->to_tile);
  for (uint i = firsts[k]; i < firsts[k + 1]; ++i)
    add_disc(tile, &frame, shape + 9 * (size_t)discs[i], reach[discs[i]], filter, gap,
             has_colors ? colors[order[discs[i]]] : 0u, keys + tile->offset,
             sums + SUMS * (size_t)tile->offset);
  const uint begin = tile->offset, end = begin + tile->width * tile->height;
  for (uint at = begin; at < end; ++at) {
    __global const float* sum = sums + SUMS * (size_t)at;
    if (keys[at] == 0 || !(sum[WEIGHT] > 0.0f)) continue;
    const float3 normal = normalize((float3)(sum[NORMAL], sum[NORMAL + 1], sum[NORMAL + 2]));
    const float2 slope = -normal.xy / max(normal.z, RBVH_STEEP_COSINE);
    const float rise = 0.5f * (slope.x * sum[AWAY] + slope.y * sum[AWAY + 1]);
    const float above = clamp((sum[HEIGHT] + rise) / sum[WEIGHT], -gap, gap);
    const float height = (float)key_height(keys[at]) + above * tile->texel_w;
    keys[at] = (keys[at] & 0xff000000u) | max(fine_height(height), 1u);
    texel_normals[at] = pack_normal(frame.u * normal.x + frame.v * normal.y + frame.w * normal.z);
    if (has_colors)
      texel_colors[at] = 0x10000u | pack_color((float4)(sum[COLOR], sum[COLOR + 1], sum[COLOR + 2], 0.0f) /
                                               sum[COLOR_WEIGHT]);
  }
}
