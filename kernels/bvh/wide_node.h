// Where a ray, or rays together (a beam of a camera's, a packet), meets a wide node: its 16 boxes are tested
// at once. And the stack of what is still to be visited.
#ifndef RBVH_WIDE_NODE_H
#define RBVH_WIDE_NODE_H
#include "kernels/bvh/prepared_ray.h"
#include "kernels/common/lanes.h"

// Multiply-adds may be fused in the box tests: they round less then, and the error bound holds.
#pragma OPENCL FP_CONTRACT ON

// Children that the ray enters between tmin and `limit`, as bits; where in `entry`.
static ALWAYS_INLINE uint intersect_children(__global const WideNode* node, const PreparedRay* q, float limit,
                                             float16* entry) {
#define PLANES(row, i, offset) (vload16(0, node->planes[q->row[i]]) * q->inverse[i] + q->offset[i])
  const float16 enter = max(max(PLANES(near_row, 0, near_offset), PLANES(near_row, 1, near_offset)),
                            max(PLANES(near_row, 2, near_offset), (float16)(q->tmin)));
  const float16 leave = min(min(PLANES(far_row, 0, far_offset), PLANES(far_row, 1, far_offset)),
                            min(PLANES(far_row, 2, far_offset), (float16)(limit)));
#undef PLANES
  *entry = enter;
  return lane_bits16(enter <= leave);
}

// All rays of a packet as one, for interval arithmetic (Boulos, Wald, Shirley, "Geometric and Arithmetic
// Culling Methods for Entire Ray Packets", 2006): the least tmin, and per axis the least and the greatest
// inverse direction with their offsets, as in PreparedRay. Along an axis in which the rays' signs differ
// `inverse` is 0 and the offsets are infinite in effect: it excludes nothing.
typedef struct IntervalRay {
  float tmin;
  float inverse[3][2], near_offset[3][2], far_offset[3][2];
  uint near_row[3], far_row[3];
} IntervalRay;

// Where an interval ray enters boxes at the earliest, and leaves them at the latest. F: the boxes' vector
// type; LOAD(row): a row of their planes; inverse, near, far: as in IntervalRay.
#define PACKET_INTERVAL(F, LOAD, ray, inverse, near, far, enter, leave)                                      \
  for (uint axis = 0; axis < 3; ++axis) {                                                                    \
    const F from = LOAD((ray)->near_row[axis]), to = LOAD((ray)->far_row[axis]);                             \
    enter = max(enter, min(from * (inverse)[axis][0] + (near)[axis][0],                                      \
                           from * (inverse)[axis][1] + (near)[axis][1]));                                    \
    leave =                                                                                                  \
        min(leave, max(to * (inverse)[axis][0] + (far)[axis][0], to * (inverse)[axis][1] + (far)[axis][1])); \
  }

// Children that any of the packet's rays may enter before `limit`, as bits; `entry`: not before it.
static ALWAYS_INLINE uint intersect_children_packet(__global const WideNode* node, const IntervalRay* b,
                                                    float limit, float16* entry) {
#define LOAD(row) vload16(0, node->planes[row])
  float16 enter = b->tmin, leave = limit;
  PACKET_INTERVAL(float16, LOAD, b, b->inverse, b->near_offset, b->far_offset, enter, leave)
#undef LOAD
  *entry = enter;
  return lane_bits16(enter <= leave);
}

#pragma OPENCL FP_CONTRACT OFF

// Takes the nearest of the children in `mask` (not 0), puts the others on the stack, farthest first. Lane i's
// child is children[i] or, without `children`, base + i.
static ALWAYS_INLINE uint take_children(__global const uint* children, uint base, uint mask, float16 entry,
                                        uint* stack, float* stack_t, uint* depth_inout) {
#define CHILD(lane) (children ? children[lane] : base + (lane))
  uint lane = lowest_bit(mask);
  mask &= mask - 1;
  uint next = CHILD(lane);
  if (mask == 0) return next;
  float t[16];
  vstore16(entry, 0, t);
  float next_t = t[lane];
  uint depth = *depth_inout;
  const uint bottom = depth;
  for (; mask != 0; mask &= mask - 1) {
    lane = lowest_bit(mask);
    uint far = CHILD(lane);
    float far_t = t[lane];
    if (far_t < next_t) {
      const uint swap = next;
      const float swap_t = next_t;
      next = far;
      next_t = far_t;
      far = swap;
      far_t = swap_t;
    }
    uint at = depth++;
    for (; at > bottom && stack_t[at - 1] < far_t; --at) {
      stack[at] = stack[at - 1];
      stack_t[at] = stack_t[at - 1];
    }
    stack[at] = far;
    stack_t[at] = far_t;
  }
#undef CHILD
  *depth_inout = depth;
  return next;
}

// The nearest of the node's children that the ray enters up to `limit`, 0 for none; the others go on the
// stack.
static ALWAYS_INLINE uint open_node(__global const WideNode* node, const PreparedRay* q, float limit,
                                    uint* stack, float* stack_t, uint* depth) {
  float16 entry;
  const uint mask = intersect_children(node, q, limit, &entry);
  return mask == 0 ? 0 : take_children(node->children, 0, mask, entry, stack, stack_t, depth);
}

// The same for a packet.
static ALWAYS_INLINE uint open_node_packet(__global const WideNode* node, const IntervalRay* b, float limit,
                                           uint* stack, float* stack_t, uint* depth) {
  float16 entry;
  const uint mask = intersect_children_packet(node, b, limit, &entry);
  return mask == 0 ? 0 : take_children(node->children, 0, mask, entry, stack, stack_t, depth);
}

// Nearest on the stack, if it begins by `limit`; else 0, which is the root and never on it.
static inline uint pop_nearer(const uint* stack, const float* stack_t, uint* depth, float limit) {
  while (*depth != 0) {
    --*depth;
    if (stack_t[*depth] <= limit) return stack[*depth];
  }
  return 0;
}
#endif
