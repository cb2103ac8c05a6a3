// Exact ray casting of a scan's triangles or discs on the device, through a binned-SAH hierarchy built on the
// host and flattened to 16-wide nodes: the picture everything else is compared with.
#pragma once

#include "kernels/exact_layout.h"
#include "kernels/layout.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/trace_rbvh.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

/// A scan in the device's own layout. Cheap to copy.
struct ExactTracer {
  Device device;
  bool discs = false;
  ExactScene scene{};
  Buffer<ExactNode> nodes;
  Buffer<ExactBlock> blocks;
  std::uint32_t stack = 0;  ///< entries that a ray can need
  std::size_t bytes() const { return nodes.size() * sizeof(ExactNode) + blocks.size() * sizeof(ExactBlock); }
};

/// Seconds by phase.
struct ExactTimings {
  double hierarchy = 0, flatten = 0, upload = 0;
};

/// A cloud needs normals and radii. Primitives that are not finite, triangles without area, discs without a
/// normal or radius are never hit. Throws Error(kBudget) when the device cannot hold it.
ExactTracer make_exact_tracer(const Device& device, const Scan& scan, ExactTimings* timings = nullptr);

/// Nearest (or any) hits of `count` rays, in their order, t in [tmin, tmax]. Hit.leaf is the triangle's or
/// point's index in the scan; of several at the same t the lowest. A triangle's u and v weigh its second and
/// third vertex. `steps`, where given, gets the nodes and blocks visited per ray.
void trace_rays(const ExactTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps = nullptr);

/// Primary rays of a camera: hits row by row.
void trace_camera(const ExactTracer& tracer, const CameraRays& camera, const Buffer<Hit>& hits,
                  const Buffer<std::uint32_t>* steps = nullptr);

}  // namespace rbvh
