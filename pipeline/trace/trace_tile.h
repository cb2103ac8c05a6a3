// Ray casting one level of an RBVH on the device (section 5 of the paper): wide top tree, tile march, refined
// hit. Packets of coherent rays by explicit vectors on a CPU, one ray a work-item otherwise.
#pragma once

#include "kernels/common/layout.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

enum class RayQuery { kNearest, kAny };

/// A level in the device's own layout. Cheap to copy.
struct TileTracer {
  Device device;
  Buffer<std::uint32_t> nodes8, nodes16;  ///< wide nodes, see kernels/trace/trace_tile.cl
  Buffer<RbvhTile> tiles;
  Buffer<std::uint16_t> heights;
  Buffer<RbvhChunk> exact;  ///< what leaves keep in place of heights
  std::uint32_t discs = 0;  ///< those are discs, not triangles
};

TileTracer make_tile_tracer(const Device& device, const Level& level);

/// Nearest (or any) hits of `count` rays, in their order. `steps`, where given, gets nodes + texel steps per
/// ray.
void trace_rays(const TileTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
                RayQuery query, const Buffer<std::uint32_t>* steps = nullptr);

/// Primary rays of a camera: hits row by row.
void trace_camera(const TileTracer& tracer, const CameraRays& camera, const Buffer<Hit>& hits,
                  const Buffer<std::uint32_t>* steps = nullptr);

}  // namespace rbvh
