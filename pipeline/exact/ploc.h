// Hierarchy by parallel locally-ordered clustering, built on the device (Meister, Bittner, "Parallel
// Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", TVCG 2018): from the leaves up,
// clusters that are each other's best neighbours along a Morton curve are merged, round by round. Slower to
// build than LBVH; its trees trace like those of the surface area heuristic.
#pragma once

#include <span>

#include "pipeline/device/device.h"
#include "pipeline/exact/bvh.h"

namespace rbvh {

struct PlocConfig {
  std::uint32_t radius = 16;  ///< places to each side in which a neighbour is sought
};

/// Boxes that are empty or not finite are left out. The tree does not depend on the device. Any number of
/// boxes below 2^31, with duplicates.
Bvh build_ploc(const Device& device, std::span<const Bounds3f> boxes, const BvhConfig& config,
               const PlocConfig& ploc = {});

}  // namespace rbvh
