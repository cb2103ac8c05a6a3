// Displaced patches as the kernels read them; shared with the host.
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
// The 16 grandchildren of node k fill block k + 1, whatever its level: two levels of the quad tree are one
// level of a 16-wide tree. A single node is 20 bytes: 6 planes, a normal, a texture coordinate.
#ifndef RBVH_PATCH_LAYOUT_H
#define RBVH_PATCH_LAYOUT_H

#include "kernels/bvh/bvh_layout.h"
#include "kernels/common/ray_queue_layout.h"

#ifndef __OPENCL_VERSION__
namespace rbvh {
#endif

#define PATCH_WIDTH 16
#define PATCH_FIRST_LANE 11  // of the root in block 0
#define PATCH_MOST_LEVEL 12
#define PATCH_LINKED_LEVEL 7  // deeper nodes' links do not fit 16 bits and are computed
#define PATCH_NOT_BUILT 0xffffffffu

// 16 nodes. Planes lo x y z, hi x y z in quanta of the patch's box, 65535 a side: minima rounded down, maxima
// up. Normals: x, y, z as signed 11, 11, 10 bits, not of unit length. uvs: of the node's centre, 16 bits
// each.
typedef struct PatchBlock {
  rbvh_u16 planes[6][PATCH_WIDTH];
  rbvh_u32 normals[PATCH_WIDTH];
  rbvh_u32 uvs[PATCH_WIDTH];
} PatchBlock;
RBVH_LAYOUT_SIZE(PatchBlock, 320);

// A patch without its hierarchy.
typedef struct Patch {
  float corners[4][3];  // of the base quad, counter-clockwise: (0,0) (1,0) (1,1) (0,1)
  float lo[3];          // the displaced surface's box
  rbvh_u32 texels;      // the first one's index in the map
  float hi[3];
  rbvh_u32 row;    // texels from one row of the map to the next
  rbvh_u32 level;  // of its tile: 2^level + 1 texels a side
  rbvh_u32 loose;  // a border can be coarse enough to leave its parts' boxes: these are then the patch's own
  float size;      // length of a side: the micro-quads' root mean square, times their number in a row
  rbvh_u32 unused;
} Patch;
RBVH_LAYOUT_SIZE(Patch, 96);

// The boxes of a patch's 4 x 4 parts: planes as in a PatchBlock, in the same order.
typedef struct PatchParts {
  rbvh_u16 planes[6][PATCH_WIDTH];
} PatchParts;
RBVH_LAYOUT_SIZE(PatchParts, 192);

// Where a patch's hierarchy is, if it is built: blocks, then the displaced vertices, x y z, row by row.
typedef struct PatchSlot {
  rbvh_u32 at;  // in the cache, in blocks; or PATCH_NOT_BUILT
  rbvh_u32 level;
} PatchSlot;
RBVH_LAYOUT_SIZE(PatchSlot, 8);

// A hierarchy to be built. edges: the level of each border, at most the patch's own: 2^level micro-quads lie
// along the border from corner i to corner i + 1, the same on both sides of it.
typedef struct PatchBuild {
  rbvh_u32 patch;
  rbvh_u32 at;  // as in PatchSlot
  rbvh_u32 level;
  rbvh_u32 edges;  // 8 bits each
} PatchBuild;
RBVH_LAYOUT_SIZE(PatchBuild, 16);

// One instance of a patch mesh. Targets and leaves number the patches of all instances through.
typedef struct PatchInstance {
  float to_object[12];  // rows of an affine map
  float lo[3];          // the object's box, in its own space
  rbvh_u32 root;        // of its patches' boxes: a node, or a leaf with BVH_LEAF_BIT
  float hi[3];
  rbvh_u32 first_target;  // of its patch 0
  rbvh_u32 first_patch;
  rbvh_u32 first_leaf;
  rbvh_u32 unused[2];
} PatchInstance;
RBVH_LAYOUT_SIZE(PatchInstance, 96);

// Rays that reached one patch: work items [begin, end) in sorted order. Where they are few, slot.at can be
// PATCH_NOT_BUILT.
typedef struct PatchJob {
  rbvh_u32 begin, end;
  rbvh_u32 instance;
  rbvh_u32 patch;
  PatchSlot slot;
  rbvh_u32 edges;  // as in PatchBuild, where the slot is not built
  rbvh_u32 unused;
} PatchJob;
RBVH_LAYOUT_SIZE(PatchJob, 32);

// The detail a ray resolves at t: width + spread * t, in units of t.
typedef struct RayDetail {
  float width, spread;
} RayDetail;
RBVH_LAYOUT_SIZE(RayDetail, 8);

// Scalars of a round's search among instances and patches (trace_patch.cl, trace_patch_packet.cl).
typedef struct PatchSearch {
  BvhRoot top;  // over the instances
  RayRange range;
  rbvh_u32 most_rays;  // at most so many go on, or begin
  RayDetail detail;
  rbvh_u32 any;         // 1: stop at any hit
  rbvh_u32 at_once;     // 1: intersect built patches on the way; 0: make work items of them too
  rbvh_u32 most_items;  // a ray
} PatchSearch;
RBVH_LAYOUT_SIZE(PatchSearch, 76);

// Scalars of cast_patches().
typedef struct PatchCast {
  rbvh_u32 jobs;
  rbvh_u32 any;
  RayDetail detail;
} PatchCast;
RBVH_LAYOUT_SIZE(PatchCast, 16);

#ifndef __OPENCL_VERSION__
}  // namespace rbvh
#endif
#endif
