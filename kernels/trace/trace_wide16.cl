// wide16: a 16-wide hierarchy over triangles (default) or discs (-DDISCS). One ray a work-item: the ray is
// tested against all boxes of a node, and all primitives of a block, in one vector instruction each. Or a
// camera's beam of 64 rays a work-item (triangles only): the bounds of the rays against all boxes of a node
// at once, and each triangle against the packets of 16 that may hit it. The default: nothing is faster on a
// CPU with wide vectors.
//
//   WideNode, 448 bytes: the boxes of 16 children, one row of 16 floats a plane, then the children
//   | lo.x 0..15 | lo.y 0..15 | lo.z 0..15 | hi.x 0..15 | hi.y 0..15 | hi.z 0..15 | child 0..15 |
//   PrimitiveBlock, 320 bytes: 8 triangles or discs, one row of 8 floats a number, then their indices
//   | a.x 0..7 | a.y 0..7 | a.z 0..7 | b.x 0..7 | ... | c.z 0..7 | id 0..7 |
//
// STACK: entries that any ray can need.
#include "kernels/bvh/primitive_block.h"
#include "kernels/bvh/wide_traverse.h"
#include "kernels/trace/hit_lanes.h"

#define NODE WideNode
#define PRIMITIVE PrimitiveBlock
#include "kernels/trace/exact_tree.h"

static ALWAYS_INLINE bool intersect_leaf(const Tree* tree, uint block, const PreparedRay* q, uint any,
                                         Found* found, uint2* visited) {
  ++visited->y;
  return intersect_block(tree->primitives, block, q, found);
}

DEFINE_TRAVERSE(traverse, Tree, PreparedRay, Found, open_node, intersect_leaf, limit_of)
DEFINE_OCCLUDED(occluded, Tree, intersect_leaf)

#include "kernels/trace/exact_kernels.h"

#ifndef DISCS
static ALWAYS_INLINE bool intersect_leaf_beam(const Tree* tree, uint block, const Beam* b, uint any,
                                              BeamFound* found, uint2* visited) {
  ++visited->y;
  return intersect_block_beam(tree->primitives, block, b, found);
}

DEFINE_TRAVERSE(traverse_beam, Tree, Beam, BeamFound, open_beam, intersect_leaf_beam, limit_of_beam)

// So that every ray finds what it finds alone.
static ALWAYS_INLINE bool takes_beam(const Beam* b) { return is_shear_of_each(b); }

// What make_hit() computes, for 16 rays at once. What is read of triangles is read once for all rays that hit
// the same.
static ALWAYS_INLINE void make_hits16(const Tree* tree, const Found16* found, const float16* o,
                                      const float16* d, HitLanes* h) {
  no_hits(h);
  const int16 hit = found->id != RBVH_NO_LEAF;
  uint triangles[16];
  int16 slot;
  const uint count = list_different(found->at, lane_bits16(hit), triangles, &slot);
  if (count == 0) return;
  float rows[9][16];
  for (uint k = 0; k < count; ++k) {
    __global const PrimitiveBlock* b = tree->primitives + triangles[k] / PRIMITIVE_BLOCK_WIDTH;
    for (uint row = 0; row < 9; ++row) rows[row][k] = b->rows[row][triangles[k] % PRIMITIVE_BLOCK_WIDTH];
  }
  float16 corners[9], n[3];
  for (uint row = 0; row < 9; ++row) corners[row] = permute16(vload16(0, rows[row]), slot);
  triangle_normals16(corners, corners + 3, corners + 6, n);
  for (uint axis = 0; axis < 3; ++axis) h->normal[axis] = select(h->normal[axis], n[axis], hit);
  h->t = select(h->t, found->t, hit);
  h->u = select(h->u, found->u, hit);
  h->v = select(h->v, found->v, hit);
  h->leaf = found->id;
  const float16 along = h->normal[0] * d[0] + h->normal[1] * d[1] + h->normal[2] * d[2];
  h->flags = select((uint16)(0u), (uint16)(RBVH_HIT_ON_PRIMITIVE), hit) |
             select((uint16)(0u), (uint16)(RBVH_HIT_BACK_FACE), along > 0.0f);
}

#include "kernels/trace/group_kernels.h"
#include "kernels/trace/beam_kernels.h"
#endif
