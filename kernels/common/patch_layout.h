// Patches of proxies as the kernels of trace_proxy.cl and build_patches.cl read them; shared with the host.
//
// A patch at level L has 2^L x 2^L micro-quads. Its hierarchy is a complete quad tree in breadth-first order:
// node 0 is the root, node k's children are 4k + 1 to 4k + 4, and the nodes of level i begin *at*
// (4^i - 1) / 3; within a level they follow a Morton curve, so child c of a node is its quarter (c & 1, c >>
// 1).
//
//   level 0        0                     node k lies in lane (k + 11) % 16 of block (k + 11) / 16:
//   level 1   1  2  3  4                 | - ... - | 0 | 1 2 3 4 |  | 5 ............ 20 |  | 21 ... 36 | ...
//   level 2   5 .... 20                        block 0                    block 1            block 2
//
// so that the 16 grandchildren of node k are all of block k + 1, whatever its level: two levels of the quad
// tree are one step of a 16-wide one, and one node at a time is still 20 bytes: 6 planes, a normal, a texture
// coordinate.
#ifndef RBVH_PATCH_LAYOUT_H
#define RBVH_PATCH_LAYOUT_H

#include "kernels/common/layout.h"

#ifndef __OPENCL_VERSION__
namespace rbvh {
#endif

#define PATCH_WIDTH 16
#define PATCH_FIRST_LANE 11  // of the root in block 0
#define PATCH_MOST_LEVEL 12
#define PATCH_LINKED_LEVEL 7  // deeper nodes' links do not fit 16 bits; they are computed
#define PATCH_NOT_BUILT 0xffffffffu

// 16 nodes. Planes lo x y z, hi x y z in quanta of the patch's box, 65535 a side: minima rounded down, maxima
// up. Normals: x, y, z as signed 11, 11, 10 bits, not of unit length. uvs: u, v as 16 bits each, of the
// middle.
typedef struct PatchBlock {
  rbvh_u16 planes[6][PATCH_WIDTH];
  rbvh_u32 normals[PATCH_WIDTH];
  rbvh_u32 uvs[PATCH_WIDTH];
} PatchBlock;
RBVH_LAYOUT_SIZE(PatchBlock, 320);

// What is known of a patch without its hierarchy.
typedef struct Patch {
  float corners[4][3];  // of the base quad, counter-clockwise: (0,0) (1,0) (1,1) (0,1)
  float lo[3];          // the displaced surface's box
  rbvh_u32 texels;      // the first one's index in the map
  float hi[3];
  rbvh_u32 row;    // texels from one row of the map to the next
  rbvh_u32 level;  // of its tile: 2^level + 1 texels a side
  rbvh_u32
      loose;   // a border can be so coarse that it leaves the parts at it; their boxes are the patch's own
  float size;  // how long it is: its micro-quads' sides, root mean square, times their number in a row
  rbvh_u32 unused;
} Patch;
RBVH_LAYOUT_SIZE(Patch, 96);

// The boxes of a patch's 4 x 4 parts, as a block's planes and in its order.
typedef struct PatchParts {
  rbvh_u16 planes[6][PATCH_WIDTH];
} PatchParts;
RBVH_LAYOUT_SIZE(PatchParts, 192);

// Where a patch's hierarchy is, if it is: blocks, then the displaced vertices, x y z, row by row.
typedef struct PatchSlot {
  rbvh_u32 at;  // in the cache, in blocks; PATCH_NOT_BUILT
  rbvh_u32 level;
} PatchSlot;
RBVH_LAYOUT_SIZE(PatchSlot, 8);

// A hierarchy to be built. edges: the level of each border, at most the patch's own: the border from corner i
// to corner i + 1 has that many micro-quads, so that a coarser neighbour sees the same.
typedef struct PatchBuild {
  rbvh_u32 patch;
  rbvh_u32 at;  // as in PatchSlot
  rbvh_u32 level;
  rbvh_u32 edges;  // 8 bits each
} PatchBuild;
RBVH_LAYOUT_SIZE(PatchBuild, 16);

// One object in the scene. Pairs and leaves number the patches of all instances through.
typedef struct PatchInstance {
  float to_object[12];  // rows of an affine map
  float lo[3];          // the object's box, in its own space
  rbvh_u32 root;        // of its patches' boxes: a node, or a leaf with BVH_LEAF_BIT
  float hi[3];
  rbvh_u32 first_pair;  // of its patch 0
  rbvh_u32 first_patch;
  rbvh_u32 first_leaf;
  rbvh_u32 unused[2];
} PatchInstance;
RBVH_LAYOUT_SIZE(PatchInstance, 96);

// Rays that reached a patch: pairs [begin, end) in sorted order. slot.at can be PATCH_NOT_BUILT: they are
// few.
typedef struct PatchJob {
  rbvh_u32 begin, end;
  rbvh_u32 instance;
  rbvh_u32 patch;
  PatchSlot slot;
  rbvh_u32 edges;  // as in PatchBuild, where the slot is not built
  rbvh_u32 unused;
} PatchJob;
RBVH_LAYOUT_SIZE(PatchJob, 32);

// The rays that a cast begins with: of `count` from `first` on every stride-th. `row`: they are rows of so
// many pixels, and neighbours shall follow each other; 0: any.
typedef struct RayRange {
  rbvh_u32 first, count, stride, row;
  rbvh_u32 keep_hits;  // they have been cast at something else
} RayRange;
RBVH_LAYOUT_SIZE(RayRange, 20);

// How fine a ray wants it: what it resolves at t is width + spread * t, in units of t.
typedef struct RayDetail {
  float width, spread;
} RayDetail;
RBVH_LAYOUT_SIZE(RayDetail, 8);

#ifndef __OPENCL_VERSION__
}  // namespace rbvh
#endif
#endif
