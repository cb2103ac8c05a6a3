// Ray casting one level of an RBVH on the device (section 5 of the paper): wide nodes, tile march, refined
// hit. On a CPU a camera's rays go in beams, others in groups of 16 that share all but the traversal; on a
// GPU one ray a work-item.
#pragma once

#include <cstddef>
#include <string>

#include "kernels/bvh/bvh_layout.h"
#include "kernels/common/layout.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/rbvh.h"
#include "rbvh/tracer.h"

namespace rbvh {

/// A level in the device's own layout. Cheap to copy.
struct TileTracer final : Tracer {
  std::string options;  ///< the kernels' -D words
  BvhRoot scene{};
  Buffer<WideNode> nodes;
  Buffer<RbvhTile> tiles;
  Buffer<std::uint16_t> heights;
  Buffer<std::byte> blocks;  ///< of a kind that `options` say
  std::uint32_t tile_count = 0;
  LatticePlace lattice{};
  const Level* level = nullptr;

  using Tracer::Tracer;
  /// t in [tmin, tmax]; of several at the same t the first tile's, else the first lane's. `steps` counts
  /// nodes and grid lines.
  void intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count, RayQuery query,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  void intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  SurfaceSamples surface(std::span<const Hit> hits, float spread) const override;
  std::uint64_t memory() const override;
};

TileTracer make_tile_tracer(const Device& device, const Level& level);

}  // namespace rbvh
