// Ray casting one level of an RBVH on the device (section 5 of the paper): wide top tree, tile march, refined
// hit. Packets of coherent rays by explicit vectors on a CPU, one ray a work-item otherwise.
#pragma once

#include <string>

#include "kernels/bvh/bvh_layout.h"
#include "kernels/common/layout.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

enum class RayQuery { kNearest, kAny };

/// A level in the device's own layout. Cheap to copy.
struct TileTracer {
  Device device;
  std::string options;  ///< the kernels' -D words
  BvhRoot scene{};
  Buffer<WideNode> nodes;
  Buffer<RbvhTile> tiles;
  Buffer<std::uint16_t> heights;
  Buffer<PrimitiveBlock> blocks;  ///< of leaves that fell back to exact primitives
};

TileTracer make_tile_tracer(const Device& device, const Level& level);

/// Nearest (or any) hits of `count` rays, in their order, t in [tmin, tmax]; of several tiles at the same t
/// the lowest leaf's. `steps`, where given, gets nodes + texel steps per ray.
void trace_rays(const TileTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
                RayQuery query, const Buffer<std::uint32_t>* steps = nullptr);

/// Primary rays of a camera: hits row by row.
void trace_camera(const TileTracer& tracer, const CameraRays& camera, const Buffer<Hit>& hits,
                  const Buffer<std::uint32_t>* steps = nullptr);

}  // namespace rbvh
