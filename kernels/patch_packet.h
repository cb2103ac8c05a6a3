// A patch's hierarchy met by sixteen rays that stay together: the bounds of all rays meet 16 boxes at once, and the rays
// that come to 16 micro-quads meet these one ray after the other. Every ray finds what it finds alone.
#ifndef RBVH_PATCH_PACKET_H
#define RBVH_PATCH_PACKET_H
#include "patch_query.h"

#define PACKET 16
// How far the directions may differ, in parts of their length, and the origins, in parts of the object. Farther apart
// the rays' bounds meet much that no ray does.
#define PACKET_SPREAD 0.1f
#define PACKET_ORIGINS 0.01f

// Rays, prepared; those that can hit anything agree in their longest axis and in all signs.
typedef struct Packet {
  Query rays[PACKET];
  uint lanes;  // rays that can hit anything, as bits
  uint first;  // one of them
  float tmin;  // the least
  float speed;  // the longest direction's length
  // The least and the greatest inverse direction, and their offsets, as in Query.
  float inverse[3][2], near_offset[3][2], far_offset[3][2];
  // By ray; where it can hit nothing tmins is infinite.
  float16 inverses[3], near_offsets[3], far_offsets[3], tmins;
} Packet;

// False where the rays do not stay together or can hit nothing.
static bool prepare_packet(const Ray* rays, uint count, const ExactScene* scene, Packet* p) {
  p->lanes = 0;
  for (uint i = 0; i < count; ++i)
    if (prepare(rays + i, scene, p->rays + i)) p->lanes |= 1u << i;
  if (p->lanes == 0) return false;
  p->first = lowest_bit(p->lanes);
  const Query* one = p->rays + p->first;
  float extent = 0.0f, squares = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    extent = max(extent, scene->hi[axis] - scene->lo[axis]);
    squares += one->direction[axis] * one->direction[axis];
  }
  float inverse[3][PACKET], near_offset[3][PACKET], far_offset[3][PACKET], tmin[PACKET];
  float near[3] = {INFINITY, INFINITY, INFINITY}, far[3] = {-INFINITY, -INFINITY, -INFINITY};
  p->speed = 0.0f;
  p->tmin = INFINITY;
  for (uint axis = 0; axis < 3; ++axis) p->inverse[axis][0] = p->inverse[axis][1] = one->inverse[axis];
  for (uint i = 0; i < PACKET; ++i) {
    const bool used = p->lanes >> i & 1;
    const Query* q = used ? p->rays + i : one;
    const float margin = 2.0f * error_bound(q->origin, scene);
    float apart = 0.0f, length2 = 0.0f;
    bool together = q->kz == one->kz;
    for (uint axis = 0; axis < 3; ++axis) {
      const float d = q->direction[axis], from_one = one->origin[axis] - q->origin[axis];
      together = together && q->near_row[axis] == one->near_row[axis] && fabs(from_one) <= PACKET_ORIGINS * extent &&
                 fabs(d) > 1e-18f * fabs(q->direction[q->kz]);
      apart += (d - one->direction[axis]) * (d - one->direction[axis]);
      length2 += d * d;
      const float outwards = copysign(margin, q->inverse[axis]);
      near[axis] = min(near[axis], (from_one - outwards) * q->inverse[axis]);
      far[axis] = max(far[axis], (from_one + outwards) * q->inverse[axis]);
      p->inverse[axis][0] = min(p->inverse[axis][0], q->inverse[axis]);
      p->inverse[axis][1] = max(p->inverse[axis][1], q->inverse[axis]);
      inverse[axis][i] = q->inverse[axis];
      near_offset[axis][i] = q->near_offset[axis];
      far_offset[axis][i] = q->far_offset[axis];
    }
    if (!together || !(apart <= PACKET_SPREAD * PACKET_SPREAD * squares)) return false;
    tmin[i] = used ? q->tmin : INFINITY;
    p->tmin = min(p->tmin, q->tmin);
    p->speed = max(p->speed, sqrt(length2));
  }
  for (uint axis = 0; axis < 3; ++axis) {
    for (uint k = 0; k < 2; ++k) {
      p->near_offset[axis][k] = near[axis] - one->origin[axis] * p->inverse[axis][k];
      p->far_offset[axis][k] = far[axis] - one->origin[axis] * p->inverse[axis][k];
    }
    p->inverses[axis] = vload16(0, inverse[axis]);
    p->near_offsets[axis] = vload16(0, near_offset[axis]);
    p->far_offsets[axis] = vload16(0, far_offset[axis]);
  }
  p->tmins = vload16(0, tmin);
  return true;
}

// Where a packet's bounds enter 16 boxes at the earliest, and leave them at the latest. LOAD: a row of planes.
#define PACKET_INTERVAL(LOAD, one, scale, near, far, enter, leave)                             \
  for (uint axis = 0; axis < 3; ++axis) {                                                      \
    const float16 from = LOAD(one->near_row[axis]), to = LOAD(one->far_row[axis]);             \
    enter = max(enter, min(mad(from, (float16)(scale[axis][0]), (float16)(near[axis][0])),     \
                           mad(from, (float16)(scale[axis][1]), (float16)(near[axis][1]))));   \
    leave = min(leave, max(mad(to, (float16)(scale[axis][0]), (float16)(far[axis][0])),        \
                           mad(to, (float16)(scale[axis][1]), (float16)(far[axis][1]))));      \
  }

// Children that any of the rays may meet before `limit`; `entry`: not before it.
static inline uint meet_children_packet(__global const ExactNode* node, const Packet* p, float limit, float16* entry) {
#define LOAD(row) vload16(0, node->planes[row])
  const Query* one = p->rays + p->first;
  float16 enter = p->tmin, leave = limit;
  PACKET_INTERVAL(LOAD, one, p->inverse, p->near_offset, p->far_offset, enter, leave)
#undef LOAD
  *entry = enter;
  return lane_bits16(enter <= leave);
}

// A packet's planes in quanta of a patch's box, as in PatchRay.
typedef struct PatchPacket {
  float scale[3][2], near[3][2], far[3][2];
  float16 scales[3], nears[3], fars[3];
} PatchPacket;

static inline void patch_packet(__global const Patch* patch, const Packet* p, PatchPacket* r) {
  for (uint axis = 0; axis < 3; ++axis) {
    const float lo = patch->lo[axis], quantum = (patch->hi[axis] - lo) * (1.0f / 65535.0f);
    for (uint k = 0; k < 2; ++k) {
      r->scale[axis][k] = quantum * p->inverse[axis][k];
      r->near[axis][k] = lo * p->inverse[axis][k] + p->near_offset[axis][k];
      r->far[axis][k] = lo * p->inverse[axis][k] + p->far_offset[axis][k];
    }
    r->scales[axis] = quantum * p->inverses[axis];
    r->nears[axis] = lo * p->inverses[axis] + p->near_offsets[axis];
    r->fars[axis] = lo * p->inverses[axis] + p->far_offsets[axis];
  }
}

// As meet_children_packet(); `left`: when all rays have left them.
static inline uint meet_planes_packet(__global const ushort (*planes)[PATCH_WIDTH], const Packet* p,
                                      const PatchPacket* r, float limit, float16* entry, float16* left) {
#define LOAD(row) convert_float16(vload16(0, planes[row]))
  const Query* one = p->rays + p->first;
  float16 enter = p->tmin, leave = limit;
  PACKET_INTERVAL(LOAD, one, r->scale, r->near, r->far, enter, leave)
#undef LOAD
  *entry = enter;
  *left = leave;
  return lane_bits16(enter <= leave);
}

// The finest level's micro-quads in block `at`, which has no boxes: the one around them all is its parent's. Returns how
// many were met.
static inline uint meet_leaves_packet(const PatchTree* tree, uint at, const Packet* p, const PatchPacket* r, float* limits,
                                      PatchFound* found) {
  const uint parent = at - 1 + PATCH_FIRST_LANE, b = at - block_count(tree->level);
  __global const PatchBlock* block = tree->blocks + parent / PATCH_WIDTH;
  const Query* one = p->rays + p->first;
  float16 enter = p->tmins, leave = vload16(0, limits);
  for (uint axis = 0; axis < 3; ++axis) {
    const float from = (float)block->planes[one->near_row[axis]][parent % PATCH_WIDTH],
                to = (float)block->planes[one->far_row[axis]][parent % PATCH_WIDTH];
    enter = max(enter, mad((float16)(from), r->scales[axis], r->nears[axis]));
    leave = min(leave, mad((float16)(to), r->scales[axis], r->fars[axis]));
  }
  uint rays = lane_bits16(enter <= leave), met = 0;
  if (rays == 0) return 0;
  Grid16 grid;
  load_grid(tree, b, one, &grid);
  for (; rays != 0; rays &= rays - 1) {
    const uint i = lowest_bit(rays);
    for (uint near = may_meet16(&grid, p->rays + i); near != 0; near &= near - 1) {
      ++met;
      if (meet_micro_quad(tree, PATCH_WIDTH * b + lowest_bit(near), p->rays + i, found + i)) limits[i] = found[i].t;
    }
  }
  return met;
}

// As traverse_patch(), nearest hits, all rays down to the micro-quads of a patch of level 2 or more. `limits`: found[].t
// of rays that can hit anything, else -infinity.
static uint traverse_patch_packet(const PatchTree* tree, __global const Patch* patch, const Packet* p, const PatchPacket* r,
                                  uint parts, float16 parts_entry, float* limits, PatchFound* found) {
  uint stack[PATCH_STACK], depth = 0, visited = 0;
  float stack_t[PATCH_STACK], limit = greatest(vload16(0, limits));
  uint current = first_visit(tree->level, patch->loose, parts, parts_entry, stack, stack_t, &depth);
  if (current == 0) return 0;
  while (true) {
    ++visited;
    const uint at = current & 0xffffff, at_level = current >> 24 & 15, quarters = current >> 28;
    uint next = 0;
    if (at_level == tree->level) {
      const uint met = meet_leaves_packet(tree, at, p, r, limits, found);
      visited += met;
      if (met > 0) limit = greatest(vload16(0, limits));
    } else {
      float16 entry, left;
      uint mask = meet_planes_packet(tree->blocks[at].planes, p, r, limit, &entry, &left);
      if (quarters != 0) mask &= four_times(quarters);
      if (mask != 0)
        next = take_children(0, VISIT(PATCH_WIDTH * at - PATCH_FIRST_LANE + 1, at_level + 2, 0u), mask, entry, stack,
                             stack_t, &depth);
    }
    while (next == 0) {
      if (depth == 0) return visited;
      --depth;
      if (stack_t[depth] <= limit) next = stack[depth];
    }
    current = next;
  }
}
#endif
