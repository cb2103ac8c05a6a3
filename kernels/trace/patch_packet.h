// A patch's hierarchy met by sixteen rays that stay together: the bounds of all rays meet 16 boxes at once,
// and the rays that come to 16 micro-quads meet these one ray after the other. Every ray finds what it finds
// alone.
#ifndef RBVH_PATCH_PACKET_H
#define RBVH_PATCH_PACKET_H
#include "kernels/trace/patch_query.h"

#define PACKET 16
// How far the directions may differ, in parts of their length, and the origins, in parts of the object.
// Farther apart the rays' bounds meet much that no ray does.
#define PACKET_SPREAD 0.1f
#define PACKET_ORIGINS 0.01f
#define PACKET_LEAST 3  // so many rays are a packet

// Sixteen rays, side by side.
typedef struct RayLanes {
  float16 origin[3], direction[3], tmin, tmax;
  uint used;  // as bits
} RayLanes;

static inline void load_lanes(const Ray* rays, uint count, RayLanes* lanes) {
  float words[8][PACKET];
  for (uint i = 0; i < PACKET; ++i) {
    const Ray ray = rays[i < count ? i : 0];
    for (uint axis = 0; axis < 3; ++axis) {
      words[axis][i] = ray.origin[axis];
      words[axis + 4][i] = ray.direction[axis];
    }
    words[3][i] = ray.tmin;
    words[7][i] = ray.tmax;
  }
  for (uint axis = 0; axis < 3; ++axis) {
    lanes->origin[axis] = vload16(0, words[axis]);
    lanes->direction[axis] = vload16(0, words[axis + 4]);
  }
  lanes->tmin = vload16(0, words[3]);
  lanes->tmax = vload16(0, words[7]);
  lanes->used = (1u << count) - 1;
}

// As object_ray().
static inline void place_lanes(const float* to_object, const RayLanes* world, RayLanes* placed) {
  const float16 *o = world->origin, *d = world->direction;
  for (uint row = 0; row < 3; ++row) {
    const float* m = to_object + 4 * row;
    placed->origin[row] = m[0] * o[0] + m[1] * o[1] + m[2] * o[2] + m[3];
    placed->direction[row] = m[0] * d[0] + m[1] * d[1] + m[2] * d[2];
  }
  placed->tmin = world->tmin;
  placed->tmax = world->tmax;
  placed->used = world->used;
}

// Rays that meet a box up to `limits`, as bits: by the arithmetic of prepare() and intersect_children().
static inline uint intersect_box_lanes(const RayLanes* rays, const BvhRoot* box, float16 limits) {
  float16 reach = 0.0f, longest = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 o = rays->origin[axis];
    reach = max(reach, max(fabs(o), max(fabs(box->lo[axis] - o), fabs(box->hi[axis] - o))));
    longest = max(longest, fabs(rays->direction[axis]));
  }
  const float16 margin = 1.2e-6f * reach;  // error_bound()
  float16 enter = rays->tmin, leave = limits;
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 o = rays->origin[axis], d = rays->direction[axis];
    const float16 inverse = select(copysign(1e18f / longest, d), 1.0f / d, fabs(d) > 1e-18f * longest);
    const float16 outwards = copysign(margin, inverse);
    const float16 near = select((float16)(box->lo[axis]), (float16)(box->hi[axis]), inverse < 0.0f),
                  far = select((float16)(box->hi[axis]), (float16)(box->lo[axis]), inverse < 0.0f);
    enter = max(enter, mad(near, inverse, -(o + outwards) * inverse));
    leave = min(leave, mad(far, inverse, -(o - outwards) * inverse));
  }
  return lane_bits16(enter <= leave) & rays->used;
}

// What prepare() makes of rays, side by side; `valid`: those that can hit anything, as bits.
typedef struct QueryLanes {
  float origin[3][PACKET], direction[3][PACKET], tmin[PACKET];
  float sx[PACKET], sy[PACKET], sz[PACKET];
  float inverse[3][PACKET], near_offset[3][PACKET], far_offset[3][PACKET];
  uint kz[PACKET];
  uint valid;
} QueryLanes;

// The same arithmetic as prepare().
static inline void prepare_lanes(const RayLanes* rays, const BvhRoot* scene, QueryLanes* q) {
  const float16 *o = rays->origin, *d = rays->direction;
  int16 valid = rays->tmin <= rays->tmax;
  float16 reach = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    valid &= isfinite(o[axis]) & isfinite(d[axis]);
    reach =
        max(reach, max(fabs(o[axis]), max(fabs(scene->lo[axis] - o[axis]), fabs(scene->hi[axis] - o[axis]))));
  }
  const float16 x = fabs(d[0]), y = fabs(d[1]), z = fabs(d[2]), xy = y > x ? y : x;
  const int16 is_y = y > x, is_z = z > xy;
  const float16 longest = is_z ? z : xy;
  q->valid = lane_bits16(valid & (longest > 0.0f)) & rays->used;
#define ALONG(first, second, third) (is_z ? (third) : is_y ? (second) : (first))
  vstore16(ALONG((uint16)(0), (uint16)(1), (uint16)(2)), 0, q->kz);
  const float16 along = ALONG(d[0], d[1], d[2]);
  vstore16(ALONG(d[1], d[2], d[0]) / along, 0, q->sx);
  vstore16(ALONG(d[2], d[0], d[1]) / along, 0, q->sy);
#undef ALONG
  vstore16(1.0f / along, 0, q->sz);
  vstore16(rays->tmin, 0, q->tmin);
  const float16 margin = 1.2e-6f * reach;  // error_bound()
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 inverse =
        select(copysign(1e18f / longest, d[axis]), 1.0f / d[axis], fabs(d[axis]) > 1e-18f * longest);
    const float16 outwards = copysign(margin, inverse);
    vstore16(o[axis], 0, q->origin[axis]);
    vstore16(d[axis], 0, q->direction[axis]);
    vstore16(inverse, 0, q->inverse[axis]);
    vstore16(-(o[axis] + outwards) * inverse, 0, q->near_offset[axis]);
    vstore16(-(o[axis] - outwards) * inverse, 0, q->far_offset[axis]);
  }
}

// Ray i's.
static inline void query_of(const QueryLanes* lanes, uint i, Query* q) {
  for (uint axis = 0; axis < 3; ++axis) {
    q->origin[axis] = lanes->origin[axis][i];
    q->direction[axis] = lanes->direction[axis][i];
    q->inverse[axis] = lanes->inverse[axis][i];
    q->near_offset[axis] = lanes->near_offset[axis][i];
    q->far_offset[axis] = lanes->far_offset[axis][i];
    q->near_row[axis] = q->inverse[axis] < 0.0f ? axis + 3 : axis;
    q->far_row[axis] = q->inverse[axis] < 0.0f ? axis : axis + 3;
  }
  q->tmin = lanes->tmin[i];
  q->kz = lanes->kz[i];
  q->kx = q->kz == 2 ? 0 : q->kz + 1;
  q->ky = q->kz == 0 ? 2 : q->kz - 1;
  q->sx = lanes->sx[i];
  q->sy = lanes->sy[i];
  q->sz = lanes->sz[i];
}

// Rays, prepared; those that can hit anything agree in their longest axis and in all signs.
typedef struct Packet {
  Query rays[PACKET];  // what micro-quads are met by; all of it for those that are `whole`, as bits
  uint whole;
  uint lanes;   // rays that can hit anything, as bits
  float speed;  // the longest direction's length
  PacketBounds bounds;
  // By ray; where it can hit nothing tmins is infinite.
  float16 inverses[3], near_offsets[3], far_offsets[3], tmins;
} Packet;

// The same arithmetic as prepare(). False where the rays do not stay together or can hit nothing.
static bool prepare_packet(const RayLanes* rays, const BvhRoot* scene, Packet* p) {
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
  const uint one = lowest_bit(p->lanes);
  const int16 bits = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  valid = (((int16)((int)p->lanes) >> bits) & 1) == 1;
  float first_o[3], first_d[3], extent = 0.0f;
  float16 apart = 0.0f, length2 = 0.0f;
  int16 together = -1;
  for (uint axis = 0; axis < 3; ++axis) {  // the others repeat one that is valid
    float each[2][PACKET];
    vstore16(o[axis], 0, each[0]);
    vstore16(d[axis], 0, each[1]);
    first_o[axis] = each[0][one];
    first_d[axis] = each[1][one];
    o[axis] = select((float16)(first_o[axis]), o[axis], valid);
    d[axis] = select((float16)(first_d[axis]), d[axis], valid);
    extent = max(extent, scene->hi[axis] - scene->lo[axis]);
    const float16 turned = d[axis] - first_d[axis];
    apart += turned * turned;
    length2 += d[axis] * d[axis];
  }
  const float16 x = fabs(d[0]), y = fabs(d[1]), z = fabs(d[2]);
  uint kz = 0;
  if (fabs(first_d[1]) > fabs(first_d[0])) kz = 1;
  if (fabs(first_d[2]) > fabs(first_d[kz])) kz = 2;
  const int16 longest_is_kz = kz == 0   ? (x >= y) & (x >= z)
                              : kz == 1 ? (y > x) & (y >= z)
                                        : (z > x) & (z > y);
  const uint kx = (kz + 1) % 3, ky = (kz + 2) % 3;
  const float16 longest = fabs(d[kz]);
  together &= longest_is_kz &
              (apart <= PACKET_SPREAD * PACKET_SPREAD *
                            (first_d[0] * first_d[0] + first_d[1] * first_d[1] + first_d[2] * first_d[2]));
  float16 reach = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    reach = max(reach, max(fabs(scene->lo[axis] - o[axis]), fabs(scene->hi[axis] - o[axis])));
    reach = max(reach, fabs(o[axis]));
    together &= (fabs(d[axis]) > 1e-18f * longest) &
                ((d[axis] < 0.0f) == (int16)(first_d[axis] < 0.0f ? -1 : 0)) &
                (fabs(first_o[axis] - o[axis]) <= PACKET_ORIGINS * extent);
  }
  if (lane_bits16(together) != 0xffffu) return false;
  const float16 margin = 1.2e-6f * reach;  // error_bound()
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 inverse = 1.0f / d[axis], outwards = copysign(margin, inverse),
                  from_first = first_o[axis] - o[axis];
    p->inverses[axis] = inverse;
    p->near_offsets[axis] = -(o[axis] + outwards) * inverse;
    p->far_offsets[axis] = -(o[axis] - outwards) * inverse;
    const bool back = first_d[axis] < 0.0f;
    p->bounds.near_row[axis] = back ? axis + 3 : axis;
    p->bounds.far_row[axis] = back ? axis : axis + 3;
    p->bounds.inverse[axis][0] = -greatest(-inverse);
    p->bounds.inverse[axis][1] = greatest(inverse);
    // From the first ray's origin, twice as far beside as each alone, as these are rounded more often.
    const float near = -greatest(-((from_first - 2.0f * outwards) * inverse)),
                far = greatest((from_first + 2.0f * outwards) * inverse);
    for (uint k = 0; k < 2; ++k) {
      p->bounds.near_offset[axis][k] = near - first_o[axis] * p->bounds.inverse[axis][k];
      p->bounds.far_offset[axis][k] = far - first_o[axis] * p->bounds.inverse[axis][k];
    }
  }
  p->tmins = select((float16)(INFINITY), rays->tmin, valid);
  p->bounds.tmin = -greatest(-p->tmins);
  p->speed = sqrt(greatest(length2));
  float words[7][PACKET];
  for (uint axis = 0; axis < 3; ++axis) vstore16(o[axis], 0, words[axis]);
  vstore16(d[kx] / d[kz], 0, words[3]);
  vstore16(d[ky] / d[kz], 0, words[4]);
  vstore16(1.0f / d[kz], 0, words[5]);
  vstore16(rays->tmin, 0, words[6]);
  for (uint i = 0; i < PACKET; ++i) {
    Query* q = p->rays + i;
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

// A packet's planes in quanta of a patch's box, as in PatchRay.
typedef struct PatchPacket {
  float scale[3][2], near[3][2], far[3][2];
  float16 scales[3], nears[3], fars[3];
} PatchPacket;

static inline void patch_packet(__global const Patch* patch, const Packet* p, PatchPacket* r) {
  for (uint axis = 0; axis < 3; ++axis) {
    const float lo = patch->lo[axis], quantum = (patch->hi[axis] - lo) * (1.0f / 65535.0f);
    for (uint k = 0; k < 2; ++k) {
      r->scale[axis][k] = quantum * p->bounds.inverse[axis][k];
      r->near[axis][k] = lo * p->bounds.inverse[axis][k] + p->bounds.near_offset[axis][k];
      r->far[axis][k] = lo * p->bounds.inverse[axis][k] + p->bounds.far_offset[axis][k];
    }
    r->scales[axis] = quantum * p->inverses[axis];
    r->nears[axis] = lo * p->inverses[axis] + p->near_offsets[axis];
    r->fars[axis] = lo * p->inverses[axis] + p->far_offsets[axis];
  }
}

// Rays that meet the patch's box up to `limits`, as bits.
static inline uint intersect_patch_box(const Packet* p, const PatchPacket* r, const float* limits) {
  float16 enter = p->tmins, leave = vload16(0, limits);
  for (uint axis = 0; axis < 3; ++axis) {
    const bool back = p->bounds.near_row[axis] > 2;
    enter = max(enter, mad((float16)(back ? 65535.0f : 0.0f), r->scales[axis], r->nears[axis]));
    leave = min(leave, mad((float16)(back ? 0.0f : 65535.0f), r->scales[axis], r->fars[axis]));
  }
  return lane_bits16(enter <= leave);
}

// As intersect_children_packet(); `left`: when all rays have left them.
static inline uint intersect_planes_packet(__global const ushort (*planes)[PATCH_WIDTH], const Packet* p,
                                           const PatchPacket* r, float limit, float16* entry, float16* left) {
#define LOAD(row) convert_float16(vload16(0, planes[row]))
  float16 enter = p->bounds.tmin, leave = limit;
  PACKET_INTERVAL(float16, LOAD, &p->bounds, r->scale, r->near, r->far, enter, leave)
#undef LOAD
  *entry = enter;
  *left = leave;
  return lane_bits16(enter <= leave);
}

// The finest level's micro-quads in block `at`, which has no boxes: the one around them all is its parent's.
// Returns how many were met.
static inline uint intersect_leaves_packet(const PatchTree* tree, uint at, const Packet* p,
                                           const PatchPacket* r, float* limits, PatchFound* found) {
  const uint parent = at - 1 + PATCH_FIRST_LANE, b = at - block_count(tree->level);
  __global const PatchBlock* block = tree->blocks + parent / PATCH_WIDTH;
  float16 enter = p->tmins, leave = vload16(0, limits);
  for (uint axis = 0; axis < 3; ++axis) {
    const float from = (float)block->planes[p->bounds.near_row[axis]][parent % PATCH_WIDTH],
                to = (float)block->planes[p->bounds.far_row[axis]][parent % PATCH_WIDTH];
    enter = max(enter, mad((float16)(from), r->scales[axis], r->nears[axis]));
    leave = min(leave, mad((float16)(to), r->scales[axis], r->fars[axis]));
  }
  uint rays = lane_bits16(enter <= leave), met = 0;
  if (rays == 0) return 0;
  Grid16 grid;
  load_grid(tree, b, p->rays, &grid);
  for (; rays != 0; rays &= rays - 1) {
    const uint i = lowest_bit(rays);
    met += intersect_grid(tree, b, &grid, p->rays + i, 0, found + i);
    limits[i] = found[i].t;
  }
  return met;
}

// As traverse_patch(), nearest hits, all rays down to the micro-quads of a patch of level 2 or more.
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
      const uint met = intersect_leaves_packet(tree, at, p, r, limits, found);
      visited += met;
      if (met > 0) limit = greatest(vload16(0, limits));
    } else {
      float16 entry, left;
      uint mask = intersect_planes_packet(tree->blocks[at].planes, p, r, limit, &entry, &left);
      if (quarters != 0) mask &= four_times(quarters);
      if (mask != 0) {
        const uint first = PATCH_WIDTH * at - PATCH_FIRST_LANE;  // lane 0's node
        ask_for(tree->blocks, first + 1, mask);
        next = take_children(0, VISIT(first + 1, at_level + 2, 0u), mask, entry, stack, stack_t, &depth);
      }
    }
    if (next == 0) next = pop_nearer(stack, stack_t, &depth, limit);
    if (next == 0) return visited;
    current = next;
  }
}
#endif
