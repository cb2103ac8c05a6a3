// How a height field is sampled and a hit refined, whoever marches: one ray, sixteen grid lines at a time
// (march_ray.h), or sixteen rays in lockstep, a grid line each (march_packet.h).
//
// In tile space a ray crosses the grid lines of its major axis (the one of u, v that it moves along faster)
// one after the other. On a line the surface is the linear interpolation of two texels, so the difference D
// between the ray's and the surface's w takes two reads, and the surface is one and the same for the cells on
// both sides: no crack inside a tile. A change of D's sign between two lines is a hit; its place is found by
// a secant and one Newton step on the bilinear patch. Texels of height 0 are empty. Neighbours further apart
// than `step_limit` are two surfaces: no wall is drawn between them. Both make D NaN, and NaN never changes
// sign.
#ifndef RBVH_MARCH_H
#define RBVH_MARCH_H
#include "kernels/common/lanes.h"
#include "kernels/trace/level_tree.h"

// Multiply-adds may be fused here: a height field is an approximation by itself.
#pragma OPENCL FP_CONTRACT ON

// In parts of the step limit, which is 8 texels: a ray that comes this near to the surface on a line, and
// goes away again, hits; and the slope of the surface that is_cut() allows for.
#define GRAZE (0.05f / 8.0f)
#define SLOPE (2.0f / 8.0f)

// Inside the leaf's box: what is rasterised past it is there for the march, not to be hit.
#define INSIDE(tile, x, y, z)                                                                          \
  (((x) >= (tile)->lo[0]) & ((x) <= (tile)->hi[0]) & ((y) >= (tile)->lo[1]) & ((y) <= (tile)->hi[1]) & \
   ((z) >= (tile)->lo[2]) & ((z) <= (tile)->hi[2]))

// Rays in a tile's space, by lane: along the axis whose grid lines they cross, along the other, and along w.
typedef struct GridRay {
  float16 o_major, d_major, i_major;  // i: 1 / d
  float16 o_minor, d_minor;
  float ow;
  float16 dw;
  int16 last_line, last_row;  // greatest numbers of lines, and of rows of cells
  int16 s_major, s_minor;     // texels from one to the next
} GridRay;

// Lane by lane: where the ray crosses the line (`t`), in which row of cells, and how far above the surface it
// is there; NaN where there is no surface.
static ALWAYS_INLINE float16 sample_line(const Tree* tree, __global const RbvhTile* tile, const GridRay* g,
                                         float16 line, float16* t, int16* row) {
  *t = (line - g->o_major) * g->i_major;
  const float16 minor = g->o_minor + g->d_minor * *t;
  *row = clamp(convert_int16(minor), (int16)(0), g->last_row);
  const int16 at = clamp(convert_int16(line), (int16)(0), g->last_line) * g->s_major + *row * g->s_minor;
  if (!LANES_IN_BOUNDS(tree->bounds, HEIGHTS, tile->offset, at)) return NAN;
  if (!LANES_IN_BOUNDS(tree->bounds, HEIGHTS, tile->offset, at + g->s_minor)) return NAN;
  __global const ushort* p = tree->heights + tile->offset;
  const float16 h0 = convert_float16(gather16(p, at)), h1 = convert_float16(gather16(p, at + g->s_minor));
  const float16 rise = h1 - h0;
  const float16 gap = (g->ow - h0) + g->dw * *t - rise * (minor - convert_float16(*row));
  const int16 solid = (h0 > 0.0f) & (h1 > 0.0f) & (fabs(rise) <= tile->step_limit);
  return select((float16)(NAN), gap, solid);
}

// Pieces of rays between two grid lines, and D where they begin and end.
typedef struct Segments {
  float16 from_t, from_D, to_t, to_D;
} Segments;

// One end has no surface, and the other is near enough to it for the ray to hit it in between.
static ALWAYS_INLINE int16 is_cut(const Segments* s, const GridRay* g, float step_limit) {
  const float16 most = fabs(g->dw * g->i_major) + SLOPE * step_limit;
  return (isnan(s->from_D) != isnan(s->to_D)) &
         (select(fabs(s->from_D), fabs(s->to_D), isnan(s->from_D)) <= most);
}

// At a tile's boundary one of the two ends may lie in the next row of cells, where a corner is missing. The
// surface on this side of the line between the rows is still there: those `which` are cut end on that line,
// which is `row`. The segments go from `line` to line + step.
static ALWAYS_INLINE void shorten(const Tree* tree, __global const RbvhTile* tile, const GridRay* g,
                                  Segments* s, int16 which, float16 line, float16 step, int16 row) {
  const int16 from = clamp(convert_int16(line), (int16)(0), g->last_line) * g->s_major + row * g->s_minor,
              to =
                  clamp(convert_int16(line + step), (int16)(0), g->last_line) * g->s_major + row * g->s_minor;
  if (!LANES_IN_BOUNDS(tree->bounds, HEIGHTS, tile->offset, from)) return;
  if (!LANES_IN_BOUNDS(tree->bounds, HEIGHTS, tile->offset, to)) return;
  __global const ushort* p = tree->heights + tile->offset;
  const float16 h0 = convert_float16(gather16(p, from)), h1 = convert_float16(gather16(p, to));
  const float16 t = (convert_float16(row) - g->o_minor) / g->d_minor;
  const float16 along = fabs(g->o_major + g->d_major * t - line);
  const int16 solid = which & (h0 > 0.0f) & (h1 > 0.0f) & (fabs(h1 - h0) <= tile->step_limit);
  const float16 D = g->ow + g->dw * t - (h0 + (h1 - h0) * along);
  const int16 at_from = solid & isnan(s->from_D), at_to = solid & ~isnan(s->from_D);
  s->from_t = select(s->from_t, t, at_from);
  s->from_D = select(s->from_D, D, at_from);
  s->to_t = select(s->to_t, t, at_to);
  s->to_D = select(s->to_D, D, at_to);
}

// Between two lines a ray may dip into what it grazes and come out again: D on a line, before and behind it.
static ALWAYS_INLINE int16 is_grazed(float16 before, float16 D, float16 behind, float step_limit) {
  return (fabs(D) < GRAZE * step_limit) & (fabs(D) <= fabs(behind)) & (fabs(D) < fabs(before));
}

// Defines  F NAME(tree, tile, u, v): the bilinear height of a patch, NaN where a corner is missing; and
// F REFINE(tree, tile, o, du, dv, dw, from_t, from_D, to_t, to_D): where a ray from o hits between two lines.
// F: one ray's type or sixteen's; I: its integers; READ: texels.
#define DEFINE_REFINE(NAME, REFINE, F, I, CONVERT, CONVERT_INT, READ, ARE_IN_BOUNDS)                         \
  static ALWAYS_INLINE F NAME(const Tree* tree, __global const RbvhTile* tile, F u, F v) {                   \
    const int width = tile->width, height = tile->height;                                                    \
    const I x = clamp(CONVERT_INT(u), (I)(0), (I)(width - 2)),                                               \
            y = clamp(CONVERT_INT(v), (I)(0), (I)(height - 2));                                              \
    const I at = y * width + x;                                                                              \
    if (!ARE_IN_BOUNDS(tree->bounds, tile->offset, at)) return NAN;                                          \
    if (!ARE_IN_BOUNDS(tree->bounds, tile->offset, at + width + 1)) return NAN;                              \
    __global const ushort* p = tree->heights + tile->offset;                                                 \
    const F a = CONVERT(READ(p, at)), b = CONVERT(READ(p + 1, at)), c = CONVERT(READ(p + width, at)),        \
            d = CONVERT(READ(p + width + 1, at));                                                            \
    const F fu = u - CONVERT(x), fv = v - CONVERT(y);                                                        \
    const F h0 = a + (b - a) * fu, h1 = c + (d - c) * fu;                                                    \
    return select((F)(NAN), h0 + (h1 - h0) * fv, (a > 0.0f) & (b > 0.0f) & (c > 0.0f) & (d > 0.0f));         \
  }                                                                                                          \
  static ALWAYS_INLINE F REFINE(const Tree* tree, __global const RbvhTile* tile, const float* o, F du, F dv, \
                                F dw, F from_t, F from_D, F to_t, F to_D) {                                  \
    const F slope = (to_D - from_D) / (to_t - from_t);                                                       \
    const F secant = from_t - from_D / slope;                                                                \
    const F h = NAME(tree, tile, o[0] + du * secant, o[1] + dv * secant);                                    \
    const F newton = secant - (o[2] + dw * secant - h) / slope;                                              \
    return select(secant, newton, (newton >= from_t) & (newton <= to_t));                                    \
  }

#define READ_ONE(p, at) (p)[at]
#define ONE_IN_BOUNDS(bounds, offset, at) IN_BOUNDS(bounds, HEIGHTS, (ulong)(offset) + (ulong)(at), 1)
#define ALL_IN_BOUNDS(bounds, offset, at) LANES_IN_BOUNDS(bounds, HEIGHTS, offset, at)
DEFINE_REFINE(patch_height, refine, float, int, (float), (int), READ_ONE, ONE_IN_BOUNDS)
DEFINE_REFINE(patch_height_packet, refine_packet, float16, int16, convert_float16, convert_int16, gather16,
              ALL_IN_BOUNDS)
#endif
