// What is seen of a cloud where rays hit its discs: normals and colours blended over the discs that overlap
// there, as in surface splatting (kernels/build/tile_blend.cl).
#pragma once

#include <span>

#include "pipeline/bvh/bvh.h"
#include "rbvh/scan.h"
#include "rbvh/tracer.h"

namespace rbvh {

/// Finds the discs near a point.
struct DiscSurface {
  Bvh bvh;
};

DiscSurface make_disc_surface(const Scan& cloud);

/// Discs count that a hit's point lies on, within the thickness of a disc, and that face as the hit one does.
SurfaceSamples sample_surface(const Scan& cloud, const DiscSurface& surface, std::span<const Hit> hits);

}  // namespace rbvh
