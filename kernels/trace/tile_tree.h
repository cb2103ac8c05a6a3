// A level of a pair as rays are cast at it: a wide hierarchy whose leaves are tiles, each a height field or a
// block of exact primitives.
#ifndef RBVH_TILE_TREE_H
#define RBVH_TILE_TREE_H
#include "kernels/bvh/bvh_layout.h"
#include "kernels/common/bounds.h"

typedef struct Tree {
  __global const WideNode* nodes;
  __global const RbvhTile* tiles;
  __global const ushort* heights;
  __global const PrimitiveBlock* blocks;
  const BvhRoot* scene;
  BOUNDS_MEMBER
} Tree;

#define TREE_ARGUMENTS                                                                            \
  __global const WideNode *nodes, __global const RbvhTile *tiles, __global const ushort *heights, \
      __global const PrimitiveBlock *blocks, BvhRoot scene
#define TREE \
  { nodes, tiles, heights, blocks, &scene BOUNDS_VALUE }

// The arguments' numbers and elements, for IN_BOUNDS.
#define TILES 1u, sizeof(RbvhTile)
#define HEIGHTS 2u, sizeof(ushort)
#define BLOCKS 3u, sizeof(PrimitiveBlock)
#endif
