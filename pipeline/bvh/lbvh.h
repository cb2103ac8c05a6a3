// Linear bounding volume hierarchy, built on the device (Lauterbach et al. 2009; topology after Karras, HPG
// 2012): elements sorted along a Morton curve, split where their codes' leading bits first differ. The
// fastest to build; its trees trace slower than those of the surface area heuristic.
#pragma once

#include <span>

#include "pipeline/bvh/bvh.h"
#include "pipeline/bvh/morton_order.h"
#include "pipeline/device/device.h"

namespace rbvh {

/// Seconds by phase.
struct LbvhTimings {
  double order = 0;  ///< codes and sort, upload included
  double sort = 0;   ///< of which the sort
  double nodes = 0;  ///< topology and boxes, readback included
  double link = 0;   ///< leaves gathered, put in order
};

/// Boxes that are empty or not finite are left out. The tree does not depend on the device. Any number of
/// boxes below 2^31, with duplicates.
Bvh build_lbvh(const Device& device, std::span<const Bounds3f> boxes, const BvhConfig& config,
               MortonBits bits = MortonBits::k63, LbvhTimings* timings = nullptr);

}  // namespace rbvh
