// Structs that host and kernels share byte for byte. Compiled as C++20 and as OpenCL C 1.2: explicit widths, no
// float3, no bool, no size_t. tests/unit/layout_test.cpp compares the device's own sizeof and offsets.
#ifndef RBVH_LAYOUT_H
#define RBVH_LAYOUT_H

#ifdef __OPENCL_VERSION__
typedef uint rbvh_u32;
typedef int rbvh_i32;
typedef ushort rbvh_u16;
#define RBVH_LAYOUT_SIZE(type, bytes)
#else
#include <cstddef>
#include <cstdint>
namespace rbvh {
typedef std::uint32_t rbvh_u32;
typedef std::int32_t rbvh_i32;
typedef std::uint16_t rbvh_u16;
#define RBVH_LAYOUT_SIZE(type, bytes) static_assert(sizeof(type) == bytes)
#endif

// A ray for the single-ray kernels. t is in units of |direction|. A miss leaves Hit.t at +infinity.
typedef struct Ray {
  float origin[3];
  float tmin;
  float direction[3];
  float tmax;
} Ray;
RBVH_LAYOUT_SIZE(Ray, 32);

#define RBVH_HIT_BACK_FACE 1u      // the ray came from behind the surface
#define RBVH_HIT_TRIANGLE_LEAF 2u  // an exact primitive was hit, not a tile
#define RBVH_NO_LEAF 0xffffffffu

// What a ray found. u, v: in [0,1] across the tile, barycentric in the triangle, or disc coordinates in [-1,1].
typedef struct Hit {
  float t;          // +infinity: nothing
  float normal[3];  // geometric, unit, unflipped
  float u, v;
  rbvh_u32 leaf;   // index of the leaf (tile), or of the triangle or disc for an exact scan; RBVH_NO_LEAF: nothing
  rbvh_u32 flags;  // RBVH_HIT_*
} Hit;
RBVH_LAYOUT_SIZE(Hit, 32);

// A pinhole camera. Pixel (x, y), column 0 at the left and row 0 on top, looks along
//   normalize(corner + right * (x + offset_x) + up * (y + offset_y)),
// where corner points from the position to the top left corner of an image plane at distance 1, right is one pixel to
// the right and up one pixel down. Directions are unit, so t is the distance in scan units. A band of rows is the same
// camera with offset_y grown by its first row and its own height.
typedef struct CameraRays {
  float position[3];
  float offset_x;  // where in the pixel, 0.5: its centre
  float corner[3];
  float offset_y;
  float right[3];
  rbvh_u32 width;
  float up[3];  // points down the image: the direction of growing y
  rbvh_u32 height;
} CameraRays;
RBVH_LAYOUT_SIZE(CameraRays, 64);

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
// The rows are orthogonal; w grows along the surface's outside. Stored heights 1..65535 are w; 0: no surface there.
typedef struct RbvhLeaf {
  float to_tile[12];
  rbvh_u16 x, y;           // first texel in the level's atlas
  rbvh_u16 width, height;  // texels, each at least 2
  rbvh_u32 primitives;     // rasterised into it
  rbvh_u32 object_id;
} RbvhLeaf;
RBVH_LAYOUT_SIZE(RbvhLeaf, 64);

#ifndef __OPENCL_VERSION__
}  // namespace rbvh
#endif
#endif
