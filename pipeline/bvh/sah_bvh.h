// A hierarchy by the surface area heuristic at every plane between two neighbouring centres, in the style of
// Wald and Havran ("On building fast kd-Trees for Ray Tracing, and on doing that in O(N log N)", RT 2006):
// the elements are sorted along each axis once, and every split keeps all three orders.
#pragma once

#include <span>

#include "pipeline/bvh/bvh.h"

namespace rbvh {

/// Boxes that are empty or not finite are left out. The tree does not depend on the number of threads. Any
/// number of boxes below 2^31, with duplicates; takes some 130 bytes a box while it builds. Below `sah_depth`
/// sets are halved, so that the depth stays bounded.
Bvh build_sah_bvh(std::span<const Bounds3f> boxes, const BvhConfig& config, int sah_depth = 64);

}  // namespace rbvh
