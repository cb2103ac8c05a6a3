// Ray casting one level of an RBVH on the device (section 5 of the paper): wide top tree, tile march, refined
// hit. Packets of coherent rays by explicit vectors on a CPU, one ray a work-item otherwise.
#pragma once

#include "kernels/common/layout.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/rbvh.h"
#include "pipeline/trace/tracer.h"

namespace rbvh {

/// A level in the device's own layout. Cheap to copy.
struct TileTracer final : Tracer {
  Buffer<std::uint32_t> nodes8, nodes16;  ///< wide nodes, see kernels/trace/trace_tile.cl
  Buffer<RbvhTile> tiles;
  Buffer<std::uint16_t> heights;
  Buffer<RbvhChunk> exact;  ///< what leaves keep in place of heights
  std::uint32_t discs = 0;  ///< those are discs, not triangles
  const Level* level = nullptr;

  using Tracer::Tracer;
  /// `steps` counts nodes and grid lines.
  void intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count, RayQuery query,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  void intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  SurfaceSamples surface(std::span<const Hit> hits) const override;
  std::uint64_t memory() const override;
};

TileTracer make_tile_tracer(const Device& device, const Level& level);

}  // namespace rbvh
