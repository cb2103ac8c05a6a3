// A level of a pair as rays are cast at it: a wide hierarchy whose leaves are tiles, numbered first, and
// blocks of the primitives that leaves hold in place of tiles. What a ray finds is a tile or, numbered after
// these, a lane of a block.
#ifndef RBVH_LEVEL_TREE_H
#define RBVH_LEVEL_TREE_H
#include "kernels/bvh/bvh_layout.h"
#include "kernels/common/bounds.h"

#if defined(DISCS)
typedef DiscBlock LeafBlock;
#elif defined(LATTICE)
typedef LatticeCluster LeafBlock;
#else
typedef FloatCluster LeafBlock;
#endif

typedef struct Tree {
  __global const WideNode* nodes;
  __global const RbvhTile* tiles;
  __global const ushort* heights;
  __global const LeafBlock* blocks;
  uint tile_count;
  const LatticePlace* lattice;
  const BvhRoot* scene;
  BOUNDS_MEMBER
} Tree;

#define TREE_ARGUMENTS                                                                            \
  __global const WideNode *nodes, __global const RbvhTile *tiles, __global const ushort *heights, \
      __global const LeafBlock *blocks, uint tile_count, LatticePlace lattice, BvhRoot scene
#define TREE \
  { nodes, tiles, heights, blocks, tile_count, &lattice, &scene BOUNDS_VALUE }

// The arguments' numbers and elements, for IN_BOUNDS.
#define TILES 1u, sizeof(RbvhTile)
#define HEIGHTS 2u, sizeof(ushort)
#define BLOCKS 3u, sizeof(LeafBlock)

static ALWAYS_INLINE uint primitive_id(const Tree* tree, uint block, uint lane) {
  return tree->tile_count + block * LEAF_BLOCK_WIDTH + lane;
}

static ALWAYS_INLINE uint leaf_of(__global const LeafBlock* block, uint lane) { return block->leaf; }

static ALWAYS_INLINE uint flags_of(__global const LeafBlock* block, uint lane) {
  return RBVH_HIT_ON_PRIMITIVE | ((uint)block->places[lane] << RBVH_HIT_PRIMITIVE_SHIFT);
}
#endif
