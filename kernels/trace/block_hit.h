// From what was found in a block to a hit. Beside what leaf_block.h asks for, the file that includes this has
// defined
//   uint leaf_of(block, lane), uint flags_of(block, lane)   a hit's leaf, and its flags but for the side.
#ifndef RBVH_BLOCK_HIT_H
#define RBVH_BLOCK_HIT_H
#include "kernels/bvh/leaf_block.h"
#include "kernels/common/no_hit.h"
#include "kernels/trace/hit_lanes.h"

#pragma OPENCL FP_CONTRACT OFF

static ALWAYS_INLINE Hit make_block_hit(const Tree* tree, const Found* found, const Ray* ray) {
  Hit h = no_hit();
  __global const LeafBlock* block = tree->blocks + found->at / LEAF_BLOCK_WIDTH;
  const uint lane = found->at % LEAF_BLOCK_WIDTH;
  const float3 n = unit_normal(tree, found->at);
  h.t = found->t;
  h.normal[0] = n.x;
  h.normal[1] = n.y;
  h.normal[2] = n.z;
  h.u = found->u;
  h.v = found->v;
#ifdef DISCS
  const float centre[3] = {block->rows[0][lane] - ray->origin[0], block->rows[1][lane] - ray->origin[1],
                           block->rows[2][lane] - ray->origin[2]},
              normal[3] = {n.x, n.y, n.z};
  disc_place(centre, normal, block->rows[6][lane], ray->direction, found->t, &h.u, &h.v);
#endif
  h.leaf = leaf_of(block, lane);
  h.flags = flags_of(block, lane);
  const float along = n.x * ray->direction[0] + n.y * ray->direction[1] + n.z * ray->direction[2];
  if (along > 0.0f) h.flags |= RBVH_HIT_BACK_FACE;
  return h;
}

#define OF_EACH(row) permute16(vload16(0, row), slot)

// What make_block_hit() computes, but for the side, for the rays of `which`. What is read of primitives is
// read once for all rays that hit the same.
static ALWAYS_INLINE void put_block_hits(const Tree* tree, const Found16* found, const float16* o,
                                         const float16* d, int16 which, HitLanes* h) {
  uint primitives[16];
  int16 slot;
  const uint count = list_different(found->at, lane_bits16(which), primitives, &slot);
  float leaf[16], flags[16];  // bits
  float rows[9][16];
  for (uint i = 0; i < count; ++i) {
    const uint lane = primitives[i] % LEAF_BLOCK_WIDTH;
    __global const LeafBlock* b = tree->blocks + primitives[i] / LEAF_BLOCK_WIDTH;
    leaf[i] = as_float(leaf_of(b, lane));
    flags[i] = as_float(flags_of(b, lane));
#ifdef DISCS
    for (uint row = 0; row < 7; ++row) rows[row][i] = b->rows[row][lane];
#else
    for (uint k = 0; k < 3; ++k) {
      const float3 corner = block_vertex(tree, b, b->corners[k][lane]);
      rows[3 * k][i] = corner.x;
      rows[3 * k + 1][i] = corner.y;
      rows[3 * k + 2][i] = corner.z;
    }
#endif
  }
  float16 n[3], u = found->u, v = found->v;
#ifdef DISCS
  const float16 centre[3] = {OF_EACH(rows[0]) - o[0], OF_EACH(rows[1]) - o[1], OF_EACH(rows[2]) - o[2]};
  for (uint axis = 0; axis < 3; ++axis) n[axis] = OF_EACH(rows[3 + axis]);
  disc_place16(centre, n, OF_EACH(rows[6]), d, found->t, &u, &v);
#else
  float16 corners[3][3];
  for (uint k = 0; k < 3; ++k)
    for (uint axis = 0; axis < 3; ++axis) corners[k][axis] = OF_EACH(rows[3 * k + axis]);
  triangle_normals16(corners[0], corners[1], corners[2], n);
#endif
  for (uint axis = 0; axis < 3; ++axis) h->normal[axis] = select(h->normal[axis], n[axis], which);
  h->u = select(h->u, u, which);
  h->v = select(h->v, v, which);
  h->leaf = select(h->leaf, as_uint16(OF_EACH(leaf)), which);
  h->flags = select(h->flags, as_uint16(OF_EACH(flags)), which);
}

static ALWAYS_INLINE void mark_back_faces(const float16* d, HitLanes* h) {
  const float16 along = h->normal[0] * d[0] + h->normal[1] * d[1] + h->normal[2] * d[2];
  h->flags |= select((uint16)(0u), (uint16)(RBVH_HIT_BACK_FACE), along > 0.0f);
}
#endif
