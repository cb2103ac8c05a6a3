// What the traversals read, each drawn in its own kernel file; host and kernel share it byte for byte like
// layout.h.
#ifndef RBVH_BVH_LAYOUT_H
#define RBVH_BVH_LAYOUT_H

#include "kernels/common/layout.h"

#ifndef __OPENCL_VERSION__
namespace rbvh {
#endif

#define WIDE_NODE_WIDTH 16
#define BVH_LEAF_BIT 0x80000000u  // a child with it is a leaf, without it a node

// --- wide hierarchies: wide16, tiles, patches
// Boxes of up to 16 children, one row a plane: lo x y z, hi x y z. An unused slot is a box far away without
// extent: an inverted box would pass a slab test whose rows are swapped. Its child is leaf 0.
typedef struct WideNode {
  float planes[6][WIDE_NODE_WIDTH];
  rbvh_u32 children[WIDE_NODE_WIDTH];
} WideNode;
RBVH_LAYOUT_SIZE(WideNode, 448);

// Where a level's lattice lies: points origin + k * step, k whole.
typedef struct LatticePlace {
  float origin[3];
  float step;
} LatticePlace;
RBVH_LAYOUT_SIZE(LatticePlace, 16);

#define LEAF_BLOCK_WIDTH 16

// --- blocks: the primitives of a leaf of wide16's, or of a level
// Two planes that a block's primitives lie between: points p with slab[0] <= normal . p / 128 <= slab[1].
typedef struct BlockSlab {
  float slab[2];
  signed char normal[3];
  rbvh_u8 count;  // of the primitives
} BlockSlab;
RBVH_LAYOUT_SIZE(BlockSlab, 12);

// Up to 16 triangles over up to 16 vertices. Unused lanes repeat the last triangle. Rays that pass by read
// the first four cache lines.
typedef struct FloatCluster {
  float vertices[3][LEAF_BLOCK_WIDTH];
  rbvh_u8 corners[3][LEAF_BLOCK_WIDTH];
  BlockSlab between;
  rbvh_u32 leaf;                      // of the level, that holds the triangles
  rbvh_u32 places[LEAF_BLOCK_WIDTH];  // which of the leaf's each lane is, or of the scan's; ascending
} FloatCluster;
RBVH_LAYOUT_SIZE(FloatCluster, 320);

// The same of vertices at origin + (base + vertex) * step of the level's lattice.
typedef struct LatticeCluster {
  rbvh_u16 vertices[3][LEAF_BLOCK_WIDTH];
  rbvh_u8 corners[3][LEAF_BLOCK_WIDTH];
  rbvh_i32 base[3];
  BlockSlab between;
  rbvh_u32 leaf;
  rbvh_u8 places[LEAF_BLOCK_WIDTH];
  rbvh_u32 unused;
} LatticeCluster;
RBVH_LAYOUT_SIZE(LatticeCluster, 192);

// Up to 16 discs: centre, unit normal, radius. Unused lanes are NaN.
typedef struct DiscBlock {
  float rows[7][LEAF_BLOCK_WIDTH];
  rbvh_u32 places[LEAF_BLOCK_WIDTH];
  BlockSlab between;
  rbvh_u32 leaf;
  rbvh_u32 unused[12];
} DiscBlock;
RBVH_LAYOUT_SIZE(DiscBlock, 576);

// --- bvh-stack, bvh-trail, bvh-parent
// A triangle that is tested alone. In a BVH a leaf's triangles lie one behind the other, the last one marked.
typedef struct BvhTriangle {
  float a[3];
  rbvh_u32 id;  // in the scan
  float b[3];
  rbvh_u32 is_last;
  float c[3];
  rbvh_u32 unused;
} BvhTriangle;
RBVH_LAYOUT_SIZE(BvhTriangle, 48);

// The boxes of two children, one row a plane: lo x y z, hi x y z.
typedef struct NodePair {
  float planes[6][2];
  rbvh_u32 children[2];
  rbvh_u32 unused[2];
} NodePair;
RBVH_LAYOUT_SIZE(NodePair, 64);

#define PARENT_INDEX_MASK 0x1fffffffu
#define PARENT_AXIS_SHIFT 29

// A node with its own box and links down and up, each with an axis. Siblings differ in the lowest bit.
typedef struct ParentNode {
  float lo[3];
  rbvh_u32 down;
  float hi[3];
  rbvh_u32 up;
} ParentNode;
RBVH_LAYOUT_SIZE(ParentNode, 32);

// --- kd-stack, kd-pushdown, kd-backtrack
#define KD_LEAF 3u  // for an axis

// Inner: a plane, and two children one behind the other. Leaf: references.
typedef struct KdCutNode {
  float position;  // leaf: the number of references, as bits
  rbvh_u32 link;   // axis (bits 0, 1); first child or first reference
} KdCutNode;
RBVH_LAYOUT_SIZE(KdCutNode, 8);

// The same with the cell's box and the way up.
typedef struct KdCellNode {
  float lo[3];
  rbvh_u32 link;
  float hi[3];
  rbvh_u32 parent;
  float position;
  rbvh_u32 unused;
} KdCellNode;
RBVH_LAYOUT_SIZE(KdCellNode, 40);

// --- all
// What all rays need: the bounds of everything, and where to start.
typedef struct BvhRoot {
  float lo[3];
  rbvh_u32 root;  // a node, or a leaf with BVH_LEAF_BIT
  float hi[3];
  rbvh_u32 unused;
} BvhRoot;
RBVH_LAYOUT_SIZE(BvhRoot, 32);

#ifndef __OPENCL_VERSION__
}  // namespace rbvh
#endif
#endif
