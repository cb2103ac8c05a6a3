// Ray casting all levels of a pair at once (section 3.5 of the paper): each ray sees the coarsest level whose
// texels its footprint covers. The paper picks a mip level for each tile that a ray meets; tiles of different
// mip levels do not meet at their borders. Here a whole level is picked for each ray, so no ray can slip
// between tiles: where neighbouring rays change level, what they see differs by less than they can tell
// apart.
#pragma once

#include <vector>

#include "pipeline/trace/trace_tile.h"

namespace rbvh {

struct FootprintTracer final : Tracer {
  std::vector<TileTracer> levels;         ///< finest first
  std::vector<float> texels;              ///< their mean side, scan units
  std::vector<std::uint32_t> first_leaf;  ///< hits number the leaves of all levels through, finest first
  Bounds3f bounds;                        ///< of all levels
  float spread = 0;  ///< of rays that are not a camera's: their width over their length; 0: the finest level

  using Tracer::Tracer;
  /// A ray is cast at the coarsest level first, to see how wide it is where it hits, and where that is too
  /// coarse again.
  void intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count, RayQuery query,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  void intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  SurfaceSamples surface(std::span<const Hit> hits, float of_rays) const override;
  std::uint64_t memory() const override;
};

FootprintTracer make_footprint_tracer(const Device& device, const Rbvh& rbvh, float spread = 0);

/// The coarsest level whose texels are no wider than `width`, the finest where none is. `texels`: finest
/// first.
std::size_t level_for_width(const std::vector<float>& texels, float width);

/// Which level a hit's leaf belongs to.
std::size_t level_of_leaf(const FootprintTracer& tracer, std::uint32_t leaf);

}  // namespace rbvh
