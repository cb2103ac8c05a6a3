// A scan's primitives on the device, in Morton order, for the partition and the rasteriser.
#pragma once

#include "pipeline/device/device.h"
#include "rbvh/scan.h"

namespace rbvh {

struct Float4 {
  float x, y, z, w;
};

struct Primitives {
  explicit Primitives(const Device& on) : device(on) {}

  Device device;
  bool discs = false;
  std::uint32_t count = 0;
  Buffer<std::uint32_t> order;    ///< Morton order -> index in the scan
  Buffer<std::uint32_t> indices;  ///< 3 vertices a triangle, in the scan's order; one dummy for discs
  Buffer<float> shape;            ///< 9 floats each (kernels/build/primitives.cl)
  Buffer<Float4> box_lo;          ///< w: area, without that of noise finer than Q0's texels
  Buffer<Float4> box_hi;
  Buffer<Float4> area_normal;    ///< w: 1 where the primitive touches a boundary edge
  Buffer<float> normals;         ///< 3 per vertex, unit
  Buffer<std::uint32_t> colors;  ///< 0xBBGGRR per vertex; one dummy without colours
  bool has_colors = false;
  Buffer<std::uint32_t> objects;  ///< ids; one dummy where all primitives are of one object
  bool has_objects = false;
  float mean_radius = 0;  ///< of the discs
  Buffer<float> reach;    ///< how far each disc is blended with others, in its radii; one dummy for triangles
  float mean_reach = 1;
  float thickness = 0;  ///< of a cloud's surface, scan units: as far apart in height, discs are still one
  double area = 0;      ///< of all, with that of noise
};

/// The work-group size that suits the device's one-work-item-one-job kernels.
std::size_t job_group_size(const Device& device);

Primitives upload_primitives(const Device& device, const Scan& scan);

}  // namespace rbvh
