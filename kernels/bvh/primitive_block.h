// Leaves of a wide hierarchy that are blocks of 8 triangles or, with -DDISCS, discs. One
// ray is tested against all 8 at once, a packet against one after the other.
#ifndef RBVH_PRIMITIVE_BLOCK_H
#define RBVH_PRIMITIVE_BLOCK_H
#include "kernels/bvh/disc.h"
#include "kernels/bvh/packet.h"
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

static ALWAYS_INLINE bool intersect_block(__global const PrimitiveBlock* blocks, uint block, const Query* q,
                                          Found* found) {
  __global const PrimitiveBlock* b = blocks + block;
  const float ox = q->origin[q->kx], oy = q->origin[q->ky], oz = q->origin[q->kz];
#define CORNER(i)                                                                       \
  {                                                                                     \
    vload8(0, b->rows[q->kx + 3 * (i)]) - ox, vload8(0, b->rows[q->ky + 3 * (i)]) - oy, \
        vload8(0, b->rows[q->kz + 3 * (i)]) - oz                                        \
  }
  const float8 p0[3] = CORNER(0), p1[3] = CORNER(1), p2[3] = CORNER(2);
#undef CORNER
  float8 t, v, w, area;
  const int8 inside = intersect_corners8(p0, p1, p2, q->sx, q->sy, q->sz, &t, &v, &w, &area);
  if (lane_bits8(inside) == 0) return false;
  const uint mask = lane_bits8(inside & (t >= q->tmin) & (t <= found->t));
  return mask != 0 && take_nearest(mask, t, v / area, w / area, blocks, block, found);
}

// Triangles of a block whose boxes any of the rays may enter before `limit`, as bits: most of a block's lie
// beside the packet.
static ALWAYS_INLINE uint intersect_boxes_packet(__global const PrimitiveBlock* b, const PacketBounds* p,
                                                 float limit) {
  float8 planes[6];
  for (uint axis = 0; axis < 3; ++axis) {
    const float8 v0 = vload8(0, b->rows[axis]), v1 = vload8(0, b->rows[axis + 3]),
                 v2 = vload8(0, b->rows[axis + 6]);
    planes[axis] = min(v0, min(v1, v2));
    planes[axis + 3] = max(v0, max(v1, v2));
  }
#define LOAD(row) planes[row]
  float8 enter = p->tmin, leave = limit;
  PACKET_INTERVAL(float8, LOAD, p, p->inverse, p->near_offset, p->far_offset, enter, leave)
#undef LOAD
  const float8 used = vload8(0, b->rows[0]);
  return lane_bits8((enter <= leave) & (used == used));
}

// The arithmetic is intersect_block()'s, so the hits are, where the packet agrees in its longest axis.
static ALWAYS_INLINE bool intersect_primitive_packet(__global const PrimitiveBlock* b, uint lane, uint at,
                                                     const Packet* p, const PacketShear* s, Found16* found) {
  const float ox = p->origin[s->kx], oy = p->origin[s->ky], oz = p->origin[s->kz];
#define CORNER(i)                                                             \
  {                                                                           \
    b->rows[s->kx + 3 * (i)][lane] - ox, b->rows[s->ky + 3 * (i)][lane] - oy, \
        b->rows[s->kz + 3 * (i)][lane] - oz                                   \
  }
  const float p0[3] = CORNER(0), p1[3] = CORNER(1), p2[3] = CORNER(2);
#undef CORNER
  float16 t, v, w, area;
  const int16 inside = intersect_corners_packet(p0, p1, p2, s->sx, s->sy, s->sz, &t, &v, &w, &area);
  if (lane_bits16(inside) == 0) return false;
  const uint id = b->ids[lane];
  const int16 taken = inside & (t >= p->bounds.tmin) & is_nearer_packet(t, id, found);
  if (lane_bits16(taken) == 0) return false;
  take_lanes(taken, t, v / area, w / area, id, at, found);
  return true;
}

static ALWAYS_INLINE bool intersect_block_packet(__global const PrimitiveBlock* blocks, uint block,
                                                 const Packet* p, const PacketShear* s, float limit,
                                                 Found16* found) {
  __global const PrimitiveBlock* b = blocks + block;
  bool taken = false;
  for (uint mask = intersect_boxes_packet(b, &p->bounds, limit); mask != 0; mask &= mask - 1) {
    const uint lane = lowest_bit(mask);
    taken |= intersect_primitive_packet(b, lane, block * PRIMITIVE_BLOCK_WIDTH + lane, p, s, found);
  }
  return taken;
}
#else
static inline float3 unit_normal(__global const PrimitiveBlock* blocks, uint at) {
  return block_vector(blocks, at, 3);
}

static ALWAYS_INLINE bool intersect_block(__global const PrimitiveBlock* blocks, uint block, const Query* q,
                                          Found* found) {
  __global const PrimitiveBlock* b = blocks + block;
  const float8 centre[3] = {vload8(0, b->rows[0]) - q->origin[0], vload8(0, b->rows[1]) - q->origin[1],
                            vload8(0, b->rows[2]) - q->origin[2]};
  const float8 normal[3] = {vload8(0, b->rows[3]), vload8(0, b->rows[4]), vload8(0, b->rows[5])};
  float8 t;
  const int8 inside = intersect_discs8(centre, normal, vload8(0, b->rows[6]), q->direction, &t);
  const uint mask = lane_bits8(inside & (t >= q->tmin) & (t <= found->t));
  if (mask == 0 || !take_nearest(mask, t, t, t, blocks, block, found)) return false;
  const uint at = found->at;
  const float2 place = disc_place(block_vector(blocks, at, 0), block_vector(blocks, at, 3),
                                  blocks[at / PRIMITIVE_BLOCK_WIDTH].rows[6][at % PRIMITIVE_BLOCK_WIDTH],
                                  (float3)(q->origin[0], q->origin[1], q->origin[2]),
                                  (float3)(q->direction[0], q->direction[1], q->direction[2]), found->t);
  found->u = place.x;
  found->v = place.y;
  return true;
}
#endif
#endif
