// Structs that host and kernels share byte for byte. Compiled as C++20 and as OpenCL C 1.2: explicit widths,
// no float3, no bool, no size_t. tests/unit/layout_test.cpp compares the device's own sizeof and offsets.
#ifndef RBVH_LAYOUT_H
#define RBVH_LAYOUT_H

#include "rbvh/ray.h"

#ifndef __OPENCL_VERSION__
namespace rbvh {
#endif

// A node of the stored binary hierarchy over tiles. Inner: count == 0, children at first and first + 1.
// Leaf: count == 1, and first is the leaf's index. Node 0 is the root.
typedef struct RbvhNode {
  float lo[3];
  rbvh_u32 first;
  float hi[3];
  rbvh_u32 count;
} RbvhNode;
RBVH_LAYOUT_SIZE(RbvhNode, 32);

// A tile: a height field over a rectangle of texels. The affine map takes a point p to tile space:
//   (u, v) in texels from the tile's first texel centre, w in height quanta,
//   row i: to_tile[4i] p.x + to_tile[4i+1] p.y + to_tile[4i+2] p.z + to_tile[4i+3].
// The rows are orthogonal; w grows along the surface's outside. Stored heights 1..65535 are w; 0: no surface
// there.
typedef struct RbvhLeaf {
  float to_tile[12];
  rbvh_u16 x, y;           // first texel in the level's atlas
  rbvh_u16 width, height;  // texels, each at least 2
  rbvh_u32 primitives;     // rasterised into it
  rbvh_u32 object_id;
} RbvhLeaf;
RBVH_LAYOUT_SIZE(RbvhLeaf, 64);

// A leaf that holds primitives in place of a tile: RbvhLeaf.primitives of the level's, from `first` on. It
// has a frame and a rectangle of texels for a user's layers, but no place in the level's atlas.
typedef struct RbvhPrimitiveLeaf {
  rbvh_u32 leaf;
  rbvh_u32 first;
} RbvhPrimitiveLeaf;
RBVH_LAYOUT_SIZE(RbvhPrimitiveLeaf, 8);

// A triangle's corners; or a disc's centre, radius, unit normal and two zeros.
typedef struct RbvhPrimitive {
  float shape[9];
} RbvhPrimitive;
RBVH_LAYOUT_SIZE(RbvhPrimitive, 36);

// A tile for tracing.
typedef struct RbvhTile {
  float columns[12];  // tile space is columns[0..2] x + [3..5] y + [6..8] z + [9..11]
  rbvh_u32 offset;    // its first texel in the heights; they lie row by row
  rbvh_u16 width, height;
  float step_limit;    // in height quanta
  float top;           // the largest height
  float lo[3], hi[3];  // the leaf's box: texels past it are for interpolation, not to be hit
  rbvh_u32 leaf;       // whose tile it is
} RbvhTile;
RBVH_LAYOUT_SIZE(RbvhTile, 92);

// --- points on the surface ---

// A leaf that a point lies near, and where: u, v in texels of its tile. `distance` in scan units to the
// leaf's surface: of a tile along its w, of a leaf of exact primitives to the nearest of them. `covers` 0:
// the point lies beside the tile's surface, and there is no `distance`.
typedef struct PointHit {
  rbvh_u32 leaf;
  float u, v;
  float distance;
  rbvh_u32 covers;
} PointHit;
RBVH_LAYOUT_SIZE(PointHit, 20);

// --- building ---

// A run of primitive references of one node or tile: what one work-item handles.
typedef struct Run {
  rbvh_u32 owner;  // node or tile
  rbvh_u32 begin, end;
} Run;
RBVH_LAYOUT_SIZE(Run, 12);

// How a node is split in two. RBVH_SPLIT_PLANE: primitives whose box centre lies below the plane go left;
// RBVH_SPLIT_FACING: those whose normal's cosine with `direction` is at least `position`; RBVH_SPLIT_COUNT:
// the references before `middle`; RBVH_SPLIT_OBJECT: those of the object `middle`; RBVH_SPLIT_BOUNDARY: those
// that touch a boundary edge of the scan.
#define RBVH_SPLIT_PLANE 0u
#define RBVH_SPLIT_FACING 1u
#define RBVH_SPLIT_COUNT 2u
#define RBVH_SPLIT_OBJECT 3u
#define RBVH_SPLIT_BOUNDARY 4u
typedef struct Split {
  rbvh_u32 kind;
  float direction[3];  // RBVH_SPLIT_PLANE: the unit vector of an axis
  float position;
  rbvh_u32
      middle;  // RBVH_SPLIT_COUNT: the first reference of the right child; RBVH_SPLIT_OBJECT: an object's id
} Split;
RBVH_LAYOUT_SIZE(Split, 24);

// The candidates for a node's split by surface area: along each axis RBVH_SAH_BINS - 1 planes at equal
// distances, bin i of a primitive's box centre c being (c - lo) * scale.
#define RBVH_SAH_BINS 33
typedef struct SplitGrid {
  float lo[3];
  float scale[3];
} SplitGrid;
RBVH_LAYOUT_SIZE(SplitGrid, 24);

// The primitives whose centres lie between two of those planes.
typedef struct SplitBin {
  float lo[3];
  float area;
  float hi[3];
  rbvh_u32 count;
} SplitBin;
RBVH_LAYOUT_SIZE(SplitBin, 32);

// The objects of some primitives: the first two ids found, and 1, 2 or, for more, 3.
typedef struct ObjectSet {
  rbvh_u32 ids[2];
  rbvh_u32 count;
} ObjectSet;
RBVH_LAYOUT_SIZE(ObjectSet, 12);

// A node of the partition, as the search for overlapping neighbours reads it: references [begin, end).
typedef struct PartitionBox {
  float lo[3];
  rbvh_i32 left;  // its children are left and left + 1; -1: none
  float hi[3];
  rbvh_u32 begin;
  rbvh_u32 end;
} PartitionBox;
RBVH_LAYOUT_SIZE(PartitionBox, 36);

// Overlapping neighbours are the primitives that touch the box and are not among the references [begin, end).
typedef struct OverlapQuery {
  float lo[3];
  rbvh_u32 begin;
  float hi[3];
  rbvh_u32 end;
} OverlapQuery;
RBVH_LAYOUT_SIZE(OverlapQuery, 32);

// Sums over some primitives; `count` of them.
typedef struct PrimitiveSums {
  float lo[3];
  rbvh_u32 count;
  float hi[3];
  float area;
  float area_normal[3];  // sum of area times unit normal; its length is the projected area
  float boundary;        // how many touch a boundary edge of the scan
} PrimitiveSums;
RBVH_LAYOUT_SIZE(PrimitiveSums, 48);

#define RBVH_FRAME_ANGLES 16

// A tile's plane before its smallest rectangle is known: `u` is rotated about `w` by RBVH_FRAME_ANGLES angles
// in [0, 90) degrees.
typedef struct TileAxes {
  float origin[4];
  float u[4], v[4], w[4];
} TileAxes;
RBVH_LAYOUT_SIZE(TileAxes, 64);

// Extents of some primitives in a TileAxes, at each angle and along w.
typedef struct TileExtents {
  float u_lo[RBVH_FRAME_ANGLES], u_hi[RBVH_FRAME_ANGLES];
  float v_lo[RBVH_FRAME_ANGLES], v_hi[RBVH_FRAME_ANGLES];
  float w_lo, w_hi;
  float unused[14];
} TileExtents;
RBVH_LAYOUT_SIZE(TileExtents, 320);

// A primitive is steep on a tile where the cosine between its normal and the tile's is below this: a height
// field is a poor fit for it.
#define RBVH_STEEP_COSINE 0.25f

// A tile being rasterised. Tile space: u, v in texels from the first texel centre; w in fine quanta,
// 0..RBVH_FINE_MAX.
#define RBVH_FINE_MAX 16777215.0f
typedef struct RasterTile {
  float to_tile[12];
  rbvh_u32 offset;         // of its first texel in the raster buffers
  rbvh_u32 width, height;  // texels
  float texel_w;           // a texel's side in fine quanta: heights and widths in one unit
} RasterTile;
RBVH_LAYOUT_SIZE(RasterTile, 64);

// What makes a height field a poor fit for a tile's primitives, counted.
typedef struct TileFaults {
  rbvh_u32 layered;  // texels covered at two heights
  rbvh_u32 steps;    // pairs of neighbouring texels too far apart in height to be one surface
  rbvh_u32 backs;    // texels' centres covered by primitives that face away, once for each
  rbvh_u32 steep;    // area of the steep primitives, in sixteenths of a texel
  rbvh_u32 misses;   // corners of triangles too far from the heights around them
} TileFaults;
RBVH_LAYOUT_SIZE(TileFaults, 20);

// A finished tile's heights.
typedef struct TileRange {
  rbvh_u32 lo, hi;  // fine quanta, over covered texels
  rbvh_u32 used;    // covered texels
} TileRange;
RBVH_LAYOUT_SIZE(TileRange, 12);

#ifndef __OPENCL_VERSION__
}  // namespace rbvh
#endif
#endif
