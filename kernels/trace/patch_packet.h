// Sixteen coherent rays traverse a patch's hierarchy together: interval arithmetic over all rays against 16
// boxes at once, and the rays that reach 16 micro-quads intersect those one ray after the other. Every ray
// finds the hit it finds alone.
#ifndef RBVH_PATCH_PACKET_H
#define RBVH_PATCH_PACKET_H
#include "kernels/bvh/ray_lanes.h"
#include "kernels/trace/traverse_patch.h"

// Rays are coherent while their directions differ by at most this much of their length, and their origins by
// this much of the object. Farther apart, the rays' intervals reach many boxes that no ray intersects.
#define PACKET_SPREAD 0.1f
#define PACKET_ORIGINS 0.01f
#define PACKET_LEAST 3  // rays that make a packet

// Prepared rays; those that can hit anything agree in their longest axis and in all signs.
typedef struct Packet {
  PreparedRay rays[PACKET];  // what micro-quads need; complete for rays in `whole`, as bits
  uint whole;
  uint lanes;   // rays that can hit anything, as bits
  float speed;  // the longest direction's length
  IntervalRay interval;
  // By ray; tmins is infinite for a ray that can hit nothing.
  float16 inverses[3], near_offsets[3], far_offsets[3], tmins;
} Packet;

// Rays on their way into a packet. Those that can hit nothing repeat one that can, the first.
typedef struct Coherent {
  float16 o[3], d[3], length2;
  int16 valid;
  float first_o[3], first_d[3];
  uint kz;
  float16 margin;  // error_bound() of each
} Coherent;

// By the arithmetic of prepare(). False where no ray can hit anything, or they are not coherent.
static ALWAYS_INLINE bool gather_coherent(const RayLanes* rays, const BvhRoot* scene, Packet* p,
                                          Coherent* c) {
  float16 o[3], d[3];
  int16 valid = rays->tmin <= rays->tmax;
  for (uint axis = 0; axis < 3; ++axis) {
    o[axis] = rays->origin[axis];
    d[axis] = rays->direction[axis];
    valid &= isfinite(o[axis]) & isfinite(d[axis]);
  }
  valid &= (d[0] != 0.0f) | (d[1] != 0.0f) | (d[2] != 0.0f);
  p->lanes = lane_bits16(valid) & rays->used;
  if (p->lanes == 0) return false;
  const uint first = lowest_bit(p->lanes);
  const int16 bits = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  c->valid = (((int16)((int)p->lanes) >> bits) & 1) == 1;
  float extent = 0.0f;
  float16 apart = 0.0f, length2 = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    float each[2][PACKET];
    vstore16(o[axis], 0, each[0]);
    vstore16(d[axis], 0, each[1]);
    c->first_o[axis] = each[0][first];
    c->first_d[axis] = each[1][first];
    c->o[axis] = select((float16)(c->first_o[axis]), o[axis], c->valid);
    c->d[axis] = select((float16)(c->first_d[axis]), d[axis], c->valid);
    extent = max(extent, scene->hi[axis] - scene->lo[axis]);
    const float16 difference = c->d[axis] - c->first_d[axis];
    apart += difference * difference;
    length2 += c->d[axis] * c->d[axis];
  }
  c->length2 = length2;
  const float* first_d = c->first_d;
  uint kz = 0;
  if (fabs(first_d[1]) > fabs(first_d[0])) kz = 1;
  if (fabs(first_d[2]) > fabs(first_d[kz])) kz = 2;
  c->kz = kz;
  const float16 x = fabs(c->d[0]), y = fabs(c->d[1]), z = fabs(c->d[2]);
  const int16 longest_is_kz = kz == 0   ? (x >= y) & (x >= z)
                              : kz == 1 ? (y > x) & (y >= z)
                                        : (z > x) & (z > y);
  const float16 longest = fabs(c->d[kz]);
  int16 coherent =
      longest_is_kz &
      (apart <= PACKET_SPREAD * PACKET_SPREAD *
                    (first_d[0] * first_d[0] + first_d[1] * first_d[1] + first_d[2] * first_d[2]));
  float16 reach = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 origin = c->o[axis], direction = c->d[axis];
    reach = max(reach, max(fabs(scene->lo[axis] - origin), fabs(scene->hi[axis] - origin)));
    reach = max(reach, fabs(origin));
    coherent &= (fabs(direction) > 1e-18f * longest) &
                ((direction < 0.0f) == (int16)(first_d[axis] < 0.0f ? -1 : 0)) &
                (fabs(c->first_o[axis] - origin) <= PACKET_ORIGINS * extent);
  }
  c->margin = 1.2e-6f * reach;  // error_bound()
  return lane_bits16(coherent) == 0xffffu;
}

// Planes' t along one axis: each ray's, and the interval over all of them.
static ALWAYS_INLINE void set_slab(const Coherent* c, uint axis, Packet* p) {
  const float16 o = c->o[axis], inverse = 1.0f / c->d[axis], outwards = copysign(c->margin, inverse);
  const float first_o = c->first_o[axis];
  const float16 from_first = first_o - o;
  p->inverses[axis] = inverse;
  p->near_offsets[axis] = -(o + outwards) * inverse;
  p->far_offsets[axis] = -(o - outwards) * inverse;
  const bool back = c->first_d[axis] < 0.0f;
  p->interval.near_row[axis] = back ? axis + 3 : axis;
  p->interval.far_row[axis] = back ? axis : axis + 3;
  p->interval.inverse[axis][0] = -greatest(-inverse);
  p->interval.inverse[axis][1] = greatest(inverse);
  // From the first ray's origin, with twice the margin of a single ray, as these are rounded more often.
  const float near = -greatest(-((from_first - 2.0f * outwards) * inverse)),
              far = greatest((from_first + 2.0f * outwards) * inverse);
  for (uint k = 0; k < 2; ++k) {
    p->interval.near_offset[axis][k] = near - first_o * p->interval.inverse[axis][k];
    p->interval.far_offset[axis][k] = far - first_o * p->interval.inverse[axis][k];
  }
}

// By the arithmetic of prepare(). False where the rays are not coherent or can hit nothing.
static bool prepare_packet(const RayLanes* rays, const BvhRoot* scene, Packet* p) {
  Coherent c;
  if (!gather_coherent(rays, scene, p, &c)) return false;
  for (uint axis = 0; axis < 3; ++axis) set_slab(&c, axis, p);
  p->tmins = select((float16)(INFINITY), rays->tmin, c.valid);
  p->interval.tmin = -greatest(-p->tmins);
  p->speed = sqrt(greatest(c.length2));
  const uint kz = c.kz, kx = (kz + 1) % 3, ky = (kz + 2) % 3;
  float words[7][PACKET];
  for (uint axis = 0; axis < 3; ++axis) vstore16(c.o[axis], 0, words[axis]);
  vstore16(c.d[kx] / c.d[kz], 0, words[3]);
  vstore16(c.d[ky] / c.d[kz], 0, words[4]);
  vstore16(1.0f / c.d[kz], 0, words[5]);
  vstore16(rays->tmin, 0, words[6]);
  for (uint i = 0; i < PACKET; ++i) {
    PreparedRay* q = p->rays + i;
    for (uint axis = 0; axis < 3; ++axis) q->origin[axis] = words[axis][i];
    q->kx = kx;
    q->ky = ky;
    q->kz = kz;
    q->sx = words[3][i];
    q->sy = words[4][i];
    q->sz = words[5][i];
    q->tmin = words[6][i];
  }
  p->whole = 0;
  return true;
}

// A packet's planes in quanta of a patch's box: see PatchRay.
typedef struct PatchPacket {
  float scale[3][2], near[3][2], far[3][2];
  float16 scales[3], nears[3], fars[3];
} PatchPacket;

static inline void patch_packet(__global const Patch* patch, const Packet* p, PatchPacket* r) {
  for (uint axis = 0; axis < 3; ++axis) {
    const float lo = patch->lo[axis], quantum = (patch->hi[axis] - lo) * (1.0f / 65535.0f);
    for (uint k = 0; k < 2; ++k) {
      r->scale[axis][k] = quantum * p->interval.inverse[axis][k];
      r->near[axis][k] = lo * p->interval.inverse[axis][k] + p->interval.near_offset[axis][k];
      r->far[axis][k] = lo * p->interval.inverse[axis][k] + p->interval.far_offset[axis][k];
    }
    r->scales[axis] = quantum * p->inverses[axis];
    r->nears[axis] = lo * p->inverses[axis] + p->near_offsets[axis];
    r->fars[axis] = lo * p->inverses[axis] + p->far_offsets[axis];
  }
}

// Rays that intersect the patch's box before `limits`, as bits.
static inline uint intersect_patch_box(const Packet* p, const PatchPacket* r, const float* limits) {
  float16 enter = p->tmins, leave = vload16(0, limits);
  for (uint axis = 0; axis < 3; ++axis) {
    const bool back = p->interval.near_row[axis] > 2;
    enter = max(enter, mad((float16)(back ? 65535.0f : 0.0f), r->scales[axis], r->nears[axis]));
    leave = min(leave, mad((float16)(back ? 0.0f : 65535.0f), r->scales[axis], r->fars[axis]));
  }
  return lane_bits16(enter <= leave);
}

// intersect_children_packet() for 16 boxes in quanta; `left`: where the last ray leaves them.
static inline uint intersect_planes_packet(__global const ushort (*planes)[PATCH_WIDTH], const Packet* p,
                                           const PatchPacket* r, float limit, float16* entry, float16* left) {
#define LOAD(row) convert_float16(vload16(0, planes[row]))
  float16 enter = p->interval.tmin, leave = limit;
  PACKET_INTERVAL(float16, LOAD, &p->interval, r->scale, r->near, r->far, enter, leave)
#undef LOAD
  *entry = enter;
  *left = leave;
  return lane_bits16(enter <= leave);
}

// The finest level's micro-quads in block `at`. The block has no boxes: the rays are tested against its
// parent node's. Returns how many ray and micro-quad tests were made.
static inline uint intersect_leaves_packet(const PatchTree* tree, uint at, const Packet* p,
                                           const PatchPacket* r, float* limits, PatchFound* found) {
  const uint parent = at - 1 + PATCH_FIRST_LANE, b = at - block_count(tree->level);
  __global const PatchBlock* block = tree->blocks + parent / PATCH_WIDTH;
  float16 enter = p->tmins, leave = vload16(0, limits);
  for (uint axis = 0; axis < 3; ++axis) {
    const float from = (float)block->planes[p->interval.near_row[axis]][parent % PATCH_WIDTH],
                to = (float)block->planes[p->interval.far_row[axis]][parent % PATCH_WIDTH];
    enter = max(enter, mad((float16)(from), r->scales[axis], r->nears[axis]));
    leave = min(leave, mad((float16)(to), r->scales[axis], r->fars[axis]));
  }
  uint rays = lane_bits16(enter <= leave), tested = 0;
  if (rays == 0) return 0;
  Grid16 grid;
  load_grid(tree, b, p->rays, &grid);
  for (; rays != 0; rays &= rays - 1) {
    const uint i = lowest_bit(rays);
    tested += intersect_grid(tree, b, &grid, p->rays + i, 0, found + i);
    limits[i] = found[i].t;
  }
  return tested;
}

// traverse_patch() for a packet: nearest hits, all rays down to the micro-quads, patches of level 2 or more.
// `limits`: found[].t of rays that can hit anything, else -infinity.
static uint traverse_patch_packet(const PatchTree* tree, __global const Patch* patch, const Packet* p,
                                  const PatchPacket* r, uint parts, float16 parts_entry, float* limits,
                                  PatchFound* found) {
  uint stack[PATCH_STACK], depth = 0, visited = 0;
  float stack_t[PATCH_STACK], limit = greatest(vload16(0, limits));
  uint current = first_visit(tree, patch->loose, parts, parts_entry, stack, stack_t, &depth);
  if (current == 0) return 0;
  while (true) {
    ++visited;
    const uint at = current & 0xffffff, at_level = current >> 24 & 15, quarters = current >> 28;
    uint next = 0;
    if (at_level == tree->level) {
      const uint tested = intersect_leaves_packet(tree, at, p, r, limits, found);
      visited += tested;
      if (tested > 0) limit = greatest(vload16(0, limits));
    } else {
      float16 entry, left;
      uint mask = intersect_planes_packet(tree->blocks[at].planes, p, r, limit, &entry, &left);
      if (quarters != 0) mask &= four_times(quarters);
      if (mask != 0) {
        const uint first = PATCH_WIDTH * at - PATCH_FIRST_LANE;  // lane 0's node
        prefetch_blocks(tree->blocks, first + 1, mask);
        next = take_children(0, VISIT(first + 1, at_level + 2, 0u), mask, entry, stack, stack_t, &depth);
      }
    }
    if (next == 0) next = pop_nearer(stack, stack_t, &depth, limit);
    if (next == 0) return visited;
    current = next;
  }
}
#endif
