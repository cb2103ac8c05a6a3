// wide16: a 16-wide hierarchy over triangles (default) or discs (-DDISCS). One ray a work-item: the ray is
// tested against all boxes of a node, and all primitives of a block, in one vector instruction each. Or 16
// rays of a camera a work-item (triangles only): the bounds of the rays against all boxes of a node at once,
// and each triangle against all rays. The default: nothing is faster on a CPU with wide vectors.
//
//   WideNode, 448 bytes: the boxes of 16 children, one row of 16 floats a plane, then the children
//   | lo.x 0..15 | lo.y 0..15 | lo.z 0..15 | hi.x 0..15 | hi.y 0..15 | hi.z 0..15 | child 0..15 |
//   PrimitiveBlock, 320 bytes: 8 triangles or discs, one row of 8 floats a number, then their indices
//   | a.x 0..7 | a.y 0..7 | a.z 0..7 | b.x 0..7 | ... | c.z 0..7 | id 0..7 |
//
// STACK: entries that any ray can need.
#include "kernels/bvh/primitive_block.h"
#include "kernels/bvh/wide_traverse.h"

#define NODE WideNode
#define PRIMITIVE PrimitiveBlock
#include "kernels/trace/exact_tree.h"

static ALWAYS_INLINE bool intersect_leaf(const Tree* tree, uint block, const Query* q, uint any, Found* found,
                                         uint2* visited) {
  ++visited->y;
  return intersect_block(tree->primitives, block, q, found);
}

DEFINE_TRAVERSE(traverse, Tree, Query, Found, open_node, intersect_leaf, limit_of)

#include "kernels/trace/exact_entries.h"

#ifndef DISCS
static ALWAYS_INLINE bool intersect_leaf_packet(const Tree* tree, uint block, const Packet* p, uint any,
                                                Found16* found, uint2* visited) {
  ++visited->y;
  return intersect_block_packet(tree->primitives, block, p, &p->shear, limit_of_packet(found), found);
}

DEFINE_TRAVERSE(traverse_packet, Tree, Packet, Found16, open_packet, intersect_leaf_packet, limit_of_packet)

// So that every ray finds what it finds alone.
static ALWAYS_INLINE bool takes_packet(Packet* p) {
  p->shear = shear_packet(p->d);
  return is_shear_of_each(p->d, p->shear.kz);
}

// What make_hit() computes, for 16 rays at once.
typedef struct HitLanes {
  float normal[3][16];
  uint back;  // as bits
} HitLanes;

static ALWAYS_INLINE void make_lanes(const Tree* tree, const FoundLanes* found, const float16* d,
                                     HitLanes* lanes) {
  float corners[9][16];
  for (uint i = 0; i < 16; ++i) {
    __global const PrimitiveBlock* b = tree->primitives + found->at[i] / PRIMITIVE_BLOCK_WIDTH;
    for (uint row = 0; row < 9; ++row) corners[row][i] = b->rows[row][found->at[i] % PRIMITIVE_BLOCK_WIDTH];
  }
  float16 a[3], b[3], c[3], n[3];
  for (uint axis = 0; axis < 3; ++axis) {
    a[axis] = vload16(0, corners[axis]);
    b[axis] = vload16(0, corners[axis + 3]);
    c[axis] = vload16(0, corners[axis + 6]);
  }
  triangle_normals16(a, b, c, n);
  for (uint axis = 0; axis < 3; ++axis) vstore16(n[axis], 0, lanes->normal[axis]);
  lanes->back = lane_bits16(n[0] * d[0] + n[1] * d[1] + n[2] * d[2] > 0.0f);
}

static ALWAYS_INLINE Hit lane_hit(const Tree* tree, const FoundLanes* found, const HitLanes* l, uint i,
                                  const Ray* ray) {
  Hit hit;
  hit.t = found->t[i];
  for (uint axis = 0; axis < 3; ++axis) hit.normal[axis] = l->normal[axis][i];
  hit.u = found->u[i];
  hit.v = found->v[i];
  hit.leaf = found->id[i];
  hit.flags = RBVH_HIT_TRIANGLE_LEAF | (l->back >> i & 1 ? RBVH_HIT_BACK_FACE : 0u);
  return hit;
}

#include "kernels/trace/group_entries.h"
#include "kernels/trace/packet_entries.h"
#endif
