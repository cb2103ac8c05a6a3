// Rays, hits and cameras, as a host and its device share them byte for byte. Compiled as C++20 and as OpenCL
// C 1.2, hence explicit widths and C's arrays.
#ifndef RBVH_RAY_H
#define RBVH_RAY_H

#ifdef __OPENCL_VERSION__
typedef uint rbvh_u32;
typedef int rbvh_i32;
typedef ushort rbvh_u16;
typedef uchar rbvh_u8;
#define RBVH_LAYOUT_SIZE(type, bytes)
#else
#include <cstddef>
#include <cstdint>
namespace rbvh {
typedef std::uint32_t rbvh_u32;
typedef std::int32_t rbvh_i32;
typedef std::uint16_t rbvh_u16;
typedef std::uint8_t rbvh_u8;
#define RBVH_LAYOUT_SIZE(type, bytes) static_assert(sizeof(type) == bytes)
#endif

// t is in units of |direction|; hits lie in [tmin, tmax]. A miss leaves Hit.t at +infinity.
typedef struct Ray {
  float origin[3];
  float tmin;
  float direction[3];
  float tmax;
} Ray;
RBVH_LAYOUT_SIZE(Ray, 32);

#define RBVH_HIT_BACK_FACE 1u       // the ray came from behind the surface
#define RBVH_HIT_ON_PRIMITIVE 2u    // a triangle or disc was hit, not a tile or a patch
#define RBVH_HIT_FLAGS 3u           // all of these
#define RBVH_HIT_PRIMITIVE_SHIFT 8  // flags >> this: which of the primitives of a pair's leaf was hit
#define RBVH_NO_LEAF 0xffffffffu

// What a ray found. u, v: in [0,1] across the tile, barycentric in the triangle, or disc coordinates in
// [-1,1].
typedef struct Hit {
  float t;          // +infinity: nothing
  float normal[3];  // geometric, unit, unflipped
  float u, v;
  rbvh_u32 leaf;   // index of the tile, or of an exact scan's triangle or disc; RBVH_NO_LEAF: nothing
  rbvh_u32 flags;  // RBVH_HIT_*, and above them the leaf's primitive
} Hit;
RBVH_LAYOUT_SIZE(Hit, 32);

// A pinhole camera. Pixel (x, y), column 0 at the left and row 0 on top, looks along
//   normalize(corner + right * (x + offset_x) + up * (y + offset_y)),
// where corner points from the position to the top left corner of an image plane at distance 1, right is one
// pixel to the right and up one pixel down. Directions are unit, so t is the distance in scan units. A band
// of rows is the same camera with offset_y grown by its first row and its own height.
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

#ifndef __OPENCL_VERSION__
}  // namespace rbvh
#endif
#endif
