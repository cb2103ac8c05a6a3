// Sixteen rays from one point march a tile in lockstep, a grid line of its own major axis each.
#ifndef RBVH_MARCH_PACKET_H
#define RBVH_MARCH_PACKET_H
#include "kernels/bvh/beam.h"
#include "kernels/trace/march.h"

#pragma OPENCL FP_CONTRACT ON

// The pieces of rays above a tile's grid.
typedef struct TilePacket {
  float o[3];  // in tile space
  float16 d[3];
  float16 t0, t1;
} TilePacket;

static ALWAYS_INLINE void enter_tile_packet(__global const RbvhTile* tile, const float* origin,
                                            const Packet* p, float16 limit, TilePacket* r) {
  __global const float* m = tile->columns;
  const float top[3] = {(float)(tile->width - 1), (float)(tile->height - 1), tile->top + 1.0f};
  r->t0 = 0.0f;
  r->t1 = limit;
#pragma unroll
  for (uint row = 0; row < 3; ++row) {
    r->o[row] = m[row] * origin[0] + m[row + 3] * origin[1] + m[row + 6] * origin[2] + m[row + 9];
    r->d[row] = m[row] * p->d[0] + m[row + 3] * p->d[1] + m[row + 6] * p->d[2] + 1e-20f;
    const float16 inverse = 1.0f / r->d[row];
    const float16 a = -r->o[row] * inverse, b = (top[row] - r->o[row]) * inverse;
    r->t0 = max(r->t0, min(a, b));
    r->t1 = min(r->t1, max(a, b));
  }
}

// Takes the rays' first crossings of the tile where they are nearer than what was found. Counts lines.
static ALWAYS_INLINE bool march_packet(const Tree* tree, uint id, const float* origin, const Packet* p,
                                       Found16* found, uint2* visited) {
  __global const RbvhTile* tile = tree->tiles + id;
  TilePacket r;
  enter_tile_packet(tile, origin, p, found->t, &r);
  int16 active = r.t0 <= r.t1;
  if (lane_bits16(active) == 0u) return false;
  const int width = tile->width, height = tile->height;
  const int16 along_u = fabs(r.d[0]) >= fabs(r.d[1]);
  GridRay g;
  g.d_major = select(r.d[1], r.d[0], along_u);
  g.d_major = copysign(max(fabs(g.d_major), 1e-8f * fabs(r.d[2])), g.d_major);
  g.d_minor = select(r.d[0], r.d[1], along_u);
  g.o_major = select((float16)(r.o[1]), (float16)(r.o[0]), along_u);
  g.o_minor = select((float16)(r.o[0]), (float16)(r.o[1]), along_u);
  g.ow = r.o[2];
  g.dw = r.d[2];
  g.last_line = select((int16)(height), (int16)(width), along_u) - 1;
  g.last_row = select((int16)(width), (int16)(height), along_u) - 2;
  g.s_major = select((int16)(width), (int16)(1), along_u);
  g.s_minor = select((int16)(1), (int16)(width), along_u);
  g.i_major = 1.0f / g.d_major;
  const float16 step = select((float16)(-1.0f), (float16)(1.0f), g.d_major > 0.0f);
  float16 line = step * floor(step * (g.o_major + g.d_major * r.t0) - 1e-3f);
  float16 t = 0.0f, D = NAN, D_before = NAN;
  int16 row = -1;
  bool any = false;
  // A map to the tile so large that a step is lost in rounding must not keep a ray here.
  for (int left = width + height + 4; left > 0; --left) {
    float16 t_line;
    int16 row_line;
    const float16 D_line = sample_line(tree, tile, &g, line, &t_line, &row_line);
    Segments s = {t, D, t_line, D_line};
    const int16 cut = is_cut(&s, &g, tile->step_limit) & (row_line != row) & (row >= 0) & active;
    if (lane_bits16(cut) != 0u) shorten(tree, tile, &g, &s, cut, line - step, step, max(row_line, row));
    const int16 crossed = (s.from_D * s.to_D <= 0.0f) & active;
    const int16 grazed = ~crossed & active & is_grazed(D_before, D, D_line, tile->step_limit);
    visited->y += 1;
    if (lane_bits16(crossed | grazed) != 0u) {
      const float16 refined =
          refine_packet(tree, tile, r.o, r.d[0], r.d[1], r.d[2], s.from_t, s.from_D, s.to_t, s.to_D);
      const float16 hit = select(refined, t, grazed);
      const int16 taken =
          (crossed | grazed) & (hit >= 0.0f) & is_nearer_packet(hit, id, found) &
          INSIDE(tile, origin[0] + p->d[0] * hit, origin[1] + p->d[1] * hit, origin[2] + p->d[2] * hit);
      found->t = select(found->t, hit, taken);
      found->id = select(found->id, (uint16)(id), taken);
      active &= ~taken;
      any |= lane_bits16(taken) != 0u;
    }
    active &= t_line < r.t1;
    if (lane_bits16(active) == 0u) return any;
    t = t_line;
    D_before = D;
    D = D_line;
    row = row_line;
    line += step;
  }
  return any;
}

static ALWAYS_INLINE bool march_beam(const Tree* tree, uint id, const Beam* b, BeamFound* found,
                                     uint2* visited) {
  __global const RbvhTile* tile = tree->tiles + id;
  bool any = false;
  for (uint packets = packets_into(b, found, tile->lo, tile->hi); packets != 0; packets &= packets - 1) {
    const uint i = lowest_bit(packets);
    Found16 nearest = found->of[i];
    if (!march_packet(tree, id, b->origin, b->packets + i, &nearest, visited)) continue;
    take_packet(&nearest, i, found);
    any = true;
  }
  return any;
}
#endif
