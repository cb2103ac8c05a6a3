// Leaves of a wide hierarchy that are blocks of 8 triangles or, with -DDISCS, discs. One
// ray is tested against all 8 at once, a beam's packets against one after the other (triangles only).
#ifndef RBVH_PRIMITIVE_BLOCK_H
#define RBVH_PRIMITIVE_BLOCK_H
#include "kernels/bvh/disc.h"
#include "kernels/bvh/beam.h"
#include "kernels/bvh/triangle.h"

// Takes the lanes in `mask` over into `found` where they are nearer.
static ALWAYS_INLINE bool take_nearest(uint mask, float8 t8, float8 u8, float8 v8,
                                       __global const PrimitiveBlock* blocks, uint block, Found* found) {
  float t[8], u[8], v[8];
  vstore8(t8, 0, t);
  vstore8(u8, 0, u);
  vstore8(v8, 0, v);
  bool any = false;
  for (; mask != 0; mask &= mask - 1) {
    const uint lane = lowest_bit(mask);
    const uint id = blocks[block].ids[lane];
    if (is_nearer(t[lane], id, found)) {
      *found = (Found){t[lane], u[lane], v[lane], id, block * PRIMITIVE_BLOCK_WIDTH + lane};
      any = true;
    }
  }
  return any;
}

// The vector in rows `row` to `row` + 2 of one primitive.
static inline float3 block_vector(__global const PrimitiveBlock* blocks, uint at, uint row) {
  __global const PrimitiveBlock* b = blocks + at / PRIMITIVE_BLOCK_WIDTH;
  const uint lane = at % PRIMITIVE_BLOCK_WIDTH;
  return (float3)(b->rows[row][lane], b->rows[row + 1][lane], b->rows[row + 2][lane]);
}

#ifndef DISCS
static inline float3 unit_normal(__global const PrimitiveBlock* blocks, uint at) {
  return triangle_normal(block_vector(blocks, at, 0), block_vector(blocks, at, 3),
                         block_vector(blocks, at, 6));
}

static ALWAYS_INLINE bool intersect_block(__global const PrimitiveBlock* blocks, uint block,
                                          const PreparedRay* q, Found* found) {
  __global const PrimitiveBlock* b = blocks + block;
#define CORNER(i)                                                                             \
  {                                                                                           \
    vload8(0, b->rows[q->kx + 3 * (i)]) - q->ox, vload8(0, b->rows[q->ky + 3 * (i)]) - q->oy, \
        vload8(0, b->rows[q->kz + 3 * (i)]) - q->oz                                           \
  }
  const float8 p0[3] = CORNER(0), p1[3] = CORNER(1), p2[3] = CORNER(2);
#undef CORNER
  float8 t, v, w, area;
  const uint inside = intersect_corners8(p0, p1, p2, q->sx, q->sy, q->sz, &t, &v, &w, &area);
  if (inside == 0) return false;
  const uint mask = inside & lane_bits8((t >= q->tmin) & (t <= found->t));
  return mask != 0 && take_nearest(mask, t, v / area, w / area, blocks, block, found);
}

// A block's triangles as a beam sees them.
typedef struct SeenBlock {
  __global const PrimitiveBlock* block;
  float ox, oy, oz;  // the beam's origin along kx, ky, kz
  uint first_at;
} SeenBlock;

static ALWAYS_INLINE uint intersect_seen_triangle(const SeenBlock* s, uint lane, const Beam* b,
                                                  const Packet* p, float16* t, float16* v, float16* w,
                                                  float16* area) {
#define CORNER(i)                                                                                 \
  {                                                                                               \
    s->block->rows[b->kx + 3 * (i)][lane] - s->ox, s->block->rows[b->ky + 3 * (i)][lane] - s->oy, \
        s->block->rows[b->kz + 3 * (i)][lane] - s->oz                                             \
  }
  const float p0[3] = CORNER(0), p1[3] = CORNER(1), p2[3] = CORNER(2);
#undef CORNER
  return intersect_corners_packet(p0, p1, p2, p->sx, p->sy, p->sz, t, v, w, area);
}

static ALWAYS_INLINE uint seen_id(const SeenBlock* s, uint lane) { return s->block->ids[lane]; }
static ALWAYS_INLINE uint seen_at(const SeenBlock* s, uint lane) { return s->first_at + lane; }

DEFINE_INTERSECT_SEEN(intersect_seen_triangles, SeenBlock, intersect_seen_triangle, seen_id, seen_at)

#define TWICE(row) (float16)(vload8(0, b->rows[row]), vload8(0, b->rows[row]))

// The arithmetic is intersect_block()'s, so the hits are, where the beam agrees in its longest axis.
static ALWAYS_INLINE bool intersect_block_beam(__global const PrimitiveBlock* blocks, uint block,
                                               const Beam* beam, BeamFound* found) {
  __global const PrimitiveBlock* b = blocks + block;
  const SeenBlock s = {b, beam->origin[beam->kx], beam->origin[beam->ky], beam->origin[beam->kz],
                       block * PRIMITIVE_BLOCK_WIDTH};
  SeenBoxes seen;
  seen.depth = FLT_MAX;
  for (uint i = 0; i < 3; ++i) {
    const float16 z = TWICE(beam->kz + 3 * i) - s.oz, u = (TWICE(beam->kx + 3 * i) - s.ox) / z,
                  v = (TWICE(beam->ky + 3 * i) - s.oy) / z;
    seen.lo[0] = i == 0 ? u : min(u, seen.lo[0]);
    seen.hi[0] = i == 0 ? u : max(u, seen.hi[0]);
    seen.lo[1] = i == 0 ? v : min(v, seen.lo[1]);
    seen.hi[1] = i == 0 ? v : max(v, seen.hi[1]);
    seen.depth = min(seen.depth, least(select((float16)(FLT_MAX), z * beam->side, z == z)));
  }
#undef TWICE
  const float8 used = vload8(0, b->rows[0]);
  seen.used = lane_bits8(used == used);
  return intersect_seen_triangles(&s, beam, &seen, found);
}
#else
static inline float3 unit_normal(__global const PrimitiveBlock* blocks, uint at) {
  return block_vector(blocks, at, 3);
}

static ALWAYS_INLINE bool intersect_block(__global const PrimitiveBlock* blocks, uint block,
                                          const PreparedRay* q, Found* found) {
  __global const PrimitiveBlock* b = blocks + block;
  const float8 centre[3] = {vload8(0, b->rows[0]) - q->origin[0], vload8(0, b->rows[1]) - q->origin[1],
                            vload8(0, b->rows[2]) - q->origin[2]};
  const float8 normal[3] = {vload8(0, b->rows[3]), vload8(0, b->rows[4]), vload8(0, b->rows[5])};
  float8 t;
  const int8 inside = intersect_discs8(centre, normal, vload8(0, b->rows[6]), q->direction, &t);
  const uint mask = lane_bits8(inside & (t >= q->tmin) & (t <= found->t));
  if (mask == 0 || !take_nearest(mask, t, t, t, blocks, block, found)) return false;
  const uint lane = found->at % PRIMITIVE_BLOCK_WIDTH;
  const float own_centre[3] = {b->rows[0][lane] - q->origin[0], b->rows[1][lane] - q->origin[1],
                               b->rows[2][lane] - q->origin[2]},
              own_normal[3] = {b->rows[3][lane], b->rows[4][lane], b->rows[5][lane]};
  disc_place(own_centre, own_normal, b->rows[6][lane], q->direction, found->t, &found->u, &found->v);
  return true;
}
#endif
#endif
