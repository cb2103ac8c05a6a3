// A level of a pair as rays are cast at it: a wide hierarchy whose leaves are tiles, numbered first, and
// blocks of the primitives that leaves hold in place of tiles. What a ray finds is a tile or, numbered after
// these, a primitive.
#ifndef RBVH_TILE_TREE_H
#define RBVH_TILE_TREE_H
#include "kernels/bvh/bvh_layout.h"
#include "kernels/common/bounds.h"

typedef struct Tree {
  __global const WideNode* nodes;
  __global const RbvhTile* tiles;
  __global const ushort* heights;
  __global const PrimitiveBlock* blocks;
  __global const uint* leaf_of;    // of each primitive
  __global const uchar* place_of;  // of each primitive, among its leaf's
  uint tile_count;
  const BvhRoot* scene;
  BOUNDS_MEMBER
} Tree;

#define TREE_ARGUMENTS                                                                                     \
  __global const WideNode *nodes, __global const RbvhTile *tiles, __global const ushort *heights,          \
      __global const PrimitiveBlock *blocks, __global const uint *leaf_of, __global const uchar *place_of, \
      uint tile_count, BvhRoot scene
#define TREE \
  { nodes, tiles, heights, blocks, leaf_of, place_of, tile_count, &scene BOUNDS_VALUE }

// The arguments' numbers and elements, for IN_BOUNDS.
#define TILES 1u, sizeof(RbvhTile)
#define HEIGHTS 2u, sizeof(ushort)
#define BLOCKS 3u, sizeof(PrimitiveBlock)
#define LEAF_OF 4u, sizeof(uint)
#endif
