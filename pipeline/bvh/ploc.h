// Hierarchy by parallel locally-ordered clustering, built on the device (Meister, Bittner, "Parallel
// Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", TVCG 2018): from the leaves up,
// clusters that are each other's best neighbours along a Morton curve are merged, round by round. Greedy
// merging makes good small clusters and poor large ones, so the few that are left become a tree by the
// surface area heuristic, as in HLBVH (Pantaleoni, Luebke, HPG 2010).
#pragma once

#include <span>

#include "pipeline/bvh/bvh.h"
#include "pipeline/device/device.h"

namespace rbvh {

struct PlocConfig {
  std::uint32_t radius = 4;  ///< places to each side in which a neighbour is sought
  /// Rounds end when clusters have so many elements on average; the host builds the tree over them.
  std::uint32_t cluster_size = 2;
};

/// Boxes that are empty or not finite are left out. The tree does not depend on the device. Any number of
/// boxes below 2^31, with duplicates.
Bvh build_ploc(const Device& device, std::span<const Bounds3f> boxes, const BvhConfig& config,
               const PlocConfig& ploc = {});

}  // namespace rbvh
