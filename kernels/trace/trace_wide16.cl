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

// What a packet found, by ray.
typedef struct HitLanes {
  float t[16], u[16], v[16], normal[3][16];
  uint id[16], back;  // back: as bits
} HitLanes;

// make_hit()'s arithmetic for 16 rays.
static ALWAYS_INLINE void make_lanes(const Tree* tree, const Found16* found, const Packet* p,
                                     HitLanes* lanes) {
  float corners[9][16];
  uint at[16];
  vstore16(found->t, 0, lanes->t);
  vstore16(found->u, 0, lanes->u);
  vstore16(found->v, 0, lanes->v);
  vstore16(found->id, 0, lanes->id);
  vstore16(found->at, 0, at);
  for (uint i = 0; i < 16; ++i) {
    __global const PrimitiveBlock* b = tree->primitives + at[i] / PRIMITIVE_BLOCK_WIDTH;
    for (uint row = 0; row < 9; ++row) corners[row][i] = b->rows[row][at[i] % PRIMITIVE_BLOCK_WIDTH];
  }
  float16 ab[3], ac[3], n[3], e = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 a = vload16(0, corners[axis]);
    ab[axis] = vload16(0, corners[axis + 3]) - a;
    ac[axis] = vload16(0, corners[axis + 6]) - a;
    e = max(e, max(fabs(ab[axis]), fabs(ac[axis])));
  }
  const float16 scale = 1.0f / e;  // as in triangle_normal()
  for (uint axis = 0; axis < 3; ++axis) {
    ab[axis] *= scale;
    ac[axis] *= scale;
  }
  for (uint axis = 0; axis < 3; ++axis) {
    n[axis] = ab[(axis + 1) % 3] * ac[(axis + 2) % 3] - ab[(axis + 2) % 3] * ac[(axis + 1) % 3];
  }
  const float16 inverse_length = 1.0f / sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  for (uint axis = 0; axis < 3; ++axis) {
    n[axis] *= inverse_length;
    vstore16(n[axis], 0, lanes->normal[axis]);
  }
  lanes->back = lane_bits16(n[0] * p->d[0] + n[1] * p->d[1] + n[2] * p->d[2] > 0.0f);
}

static ALWAYS_INLINE Hit lane_hit(const Tree* tree, const HitLanes* l, uint i) {
  Hit hit = no_hit();
  if (l->id[i] == RBVH_NO_LEAF) return hit;
  hit.t = l->t[i];
  for (uint axis = 0; axis < 3; ++axis) hit.normal[axis] = l->normal[axis][i];
  hit.u = l->u[i];
  hit.v = l->v[i];
  hit.leaf = l->id[i];
  hit.flags = RBVH_HIT_TRIANGLE_LEAF | (l->back >> i & 1 ? RBVH_HIT_BACK_FACE : 0u);
  return hit;
}

#include "kernels/trace/packet_entries.h"
#endif
