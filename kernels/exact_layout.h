// What trace_exact.cl traverses; host and kernel share it byte for byte like layout.h.
#ifndef RBVH_EXACT_LAYOUT_H
#define RBVH_EXACT_LAYOUT_H

#include "kernels/layout.h"

#ifndef __OPENCL_VERSION__
namespace rbvh {
#endif

#define EXACT_NODE_WIDTH 16
#define EXACT_BLOCK_WIDTH 8
#define EXACT_LEAF_BIT 0x80000000u  // a child with it is a block, without it a node

// Boxes of up to 16 children, one row a plane: lo x y z, hi x y z. An unused slot is a box far away without
// extent, and its child is block 0, in which nothing can be hit: an inverted box would pass a slab test whose
// rows are swapped.
typedef struct ExactNode {
  float planes[6][EXACT_NODE_WIDTH];
  rbvh_u32 children[EXACT_NODE_WIDTH];
} ExactNode;
RBVH_LAYOUT_SIZE(ExactNode, 448);

// Up to 8 triangles (vertices a, b, c: nine rows) or discs (centre, unit normal, radius: seven rows), and
// their indices in the scan. Unused lanes are NaN. Block 0 has unused lanes only.
typedef struct ExactBlock {
  float rows[9][EXACT_BLOCK_WIDTH];
  rbvh_u32 ids[EXACT_BLOCK_WIDTH];
} ExactBlock;
RBVH_LAYOUT_SIZE(ExactBlock, 320);

// What all rays need: the bounds of everything, and where to start.
typedef struct ExactScene {
  float lo[3];
  rbvh_u32 root;  // as a child
  float hi[3];
  rbvh_u32 unused;
} ExactScene;
RBVH_LAYOUT_SIZE(ExactScene, 32);

#ifndef __OPENCL_VERSION__
}  // namespace rbvh
#endif
#endif
