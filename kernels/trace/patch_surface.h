// A patch's displaced surface: where its vertices are, and the numbering of its quad tree.
#ifndef RBVH_PATCH_SURFACE_H
#define RBVH_PATCH_SURFACE_H
#include "kernels/common/patch_layout.h"

// Vertices are bitwise those of pipeline/proxy/tessellate.cpp and, on a border, those of the neighbour.
#pragma OPENCL FP_CONTRACT OFF

// The first node of a level; also the number of nodes above it.
static inline uint first_node(uint level) { return ((1u << 2 * level) - 1) / 3; }

// Blocks of a hierarchy of that level. WIDE: from level 2 on the finest level has no boxes but the grids of
// its micro-quads' vertices, which a ray intersects 16 at a time.
static inline uint block_count(uint level) {
#ifdef WIDE
  if (level >= 2) --level;
#endif
  return level == 0 ? 1 : ((4u << 2 * level) + 32) / 48;
}

static inline __global const float* slot_vertices(__global const PatchBlock* blocks, uint level) {
  return (__global const float*)(blocks + block_count(level));
}

// WIDE: the 5 x 5 vertices of 16 micro-quads, as many floats as a block: x row by row, then y, then z.
#define GRID_FLOATS 80
#define GRID_AXIS 25

// Along one axis: rows 0 to 2 begin at lanes 0, 5, 10 of `first`, rows 2 to 4 at lanes 1, 6, 11 of `second`.
typedef struct GridAxis {
  float16 first, second;
} GridAxis;

static inline GridAxis load_grid_axis(__global const float* grid, uint axis) {
  const GridAxis loaded = {vload16(0, grid + GRID_AXIS * axis), vload16(0, grid + GRID_AXIS * axis + 9)};
  return loaded;
}

// The corners (0,0), (1,0), (1,1), (0,1) of each micro-quad, of a GridAxis' two vectors.
#define GRID_A(f, s) MORTON16((f).s0123, (f).s5678, (f).sabcd, (s).s6789)
#define GRID_B(f, s) MORTON16((f).s1234, (f).s6789, (f).sbcde, (s).s789a)
#define GRID_C(f, s) MORTON16((f).s6789, (f).sbcde, (s).s789a, (s).scdef)
#define GRID_D(f, s) MORTON16((f).s5678, (f).sabcd, (s).s6789, (s).sbcde)

// Four rows of four numbers in the order of a Morton curve.
#define MORTON16(a, b, c, d) (float16)((a).lo, (b).lo, (a).hi, (b).hi, (c).lo, (d).lo, (c).hi, (d).hi)

static inline uint even_bits(uint m) {
  m &= 0x55555555u;
  m = (m | m >> 1) & 0x33333333u;
  m = (m | m >> 2) & 0x0f0f0f0fu;
  m = (m | m >> 4) & 0x00ff00ffu;
  return (m | m >> 8) & 0x0000ffffu;
}

static inline uint spread_bits(uint i) {
  i = (i | i << 8) & 0x00ff00ffu;
  i = (i | i << 4) & 0x0f0f0f0fu;
  i = (i | i << 2) & 0x33333333u;
  return (i | i << 1) & 0x55555555u;
}

static inline uint morton_of(uint i, uint j) { return spread_bits(i) | spread_bits(j) << 1; }

// Snaps the i-th of 2^level + 1 vertices to one of a border of 2^edge micro-quads. Vertices that coincide
// leave triangles without area, never a gap.
static inline uint snapped(uint i, uint level, uint edge) {
  const uint step = 1u << (level - edge);
  return (i + step / 2) & ~(step - 1);
}

static inline uint edge_level(uint edges, uint k) { return edges >> 8 * k & 0xff; }

// Vertex (i, j) of the micro-quads at `level`.
static inline float3 patch_vertex(__global const Patch* p, __global const float* map, uint level, uint edges,
                                  uint i, uint j) {
  const uint n = 1u << level;
  if (j == 0) i = snapped(i, level, edge_level(edges, 0));
  if (i == n) j = snapped(j, level, edge_level(edges, 1));
  if (j == n) i = snapped(i, level, edge_level(edges, 2));
  if (i == 0) j = snapped(j, level, edge_level(edges, 3));
  const float s = (float)i / (float)n, t = (float)j / (float)n;  // exact, as are 1 - s and 1 - t
  const uint shift = p->level - level;
  const size_t texel = (size_t)p->texels + (size_t)(j << shift) * p->row + (i << shift);
  const float3 base = (vload3(0, p->corners[0]) * (1.0f - s) + vload3(0, p->corners[1]) * s) * (1.0f - t) +
                      (vload3(0, p->corners[3]) * (1.0f - s) + vload3(0, p->corners[2]) * s) * t;
  return base + vload3(texel, map);
}

#endif
