// Exact ray casting of a scan's triangles or discs on the device, through a binned-SAH BVH8 built on the host:
// the picture everything else is compared with.
#pragma once

#include "kernels/layout.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/trace_rbvh.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

/// A scan in the device's own layout. Cheap to copy. A cloud needs normals and radii.
struct ExactTracer {
  Device device;
  bool discs = false;
  Buffer<std::uint32_t> nodes;       ///< wide nodes, see kernels/trace_exact.cl
  Buffer<float> primitives;          ///< in leaf order
  Buffer<std::uint32_t> primitive_ids;  ///< leaf order -> index in the scan
};

ExactTracer make_exact_tracer(const Device& device, const Scan& scan);

/// As for an RbvhTracer; Hit.leaf is the triangle's or point's index in the scan.
void trace_rays(const ExactTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
                RayQuery query, const Buffer<std::uint32_t>* steps = nullptr);
void trace_camera(const ExactTracer& tracer, const CameraRays& camera, const Buffer<Hit>& hits,
                  const Buffer<std::uint32_t>* steps = nullptr);

}  // namespace rbvh
