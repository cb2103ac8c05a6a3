// Simplifies a cloud within an error bound: neighbouring discs that lie in one plane become one disc. After
// Pauly, Gross and Kobbelt, "Efficient Simplification of Point-Sampled Surfaces" (IEEE Visualization 2002),
// hierarchical clustering.
#pragma once

#include <cstddef>

#include "rbvh/scan.h"

namespace rbvh {

struct MergeConfig {
  double bound = 0;  ///< from a disc's centre to the plane of what it is merged to, scan units
  double degrees =
      30;          ///< between the normals of the two, unless the disc lies within the bound all the same
  int color = 32;  ///< between the colours of the two, in any channel of 0..255
};

struct MergeCounts {
  std::size_t discs = 0;   ///< that were merged
  std::size_t merged = 0;  ///< what they became
};

/// `cloud` has normals and radii. Each merged disc covers, along its normal, all that its discs covered: no
/// hole opens between those that leave none. It has their mean centre, normal, colour and properties,
/// weighted by area. Discs of two objects, of two sides of a sheet or across a gap are not merged; those that
/// merge with no other, or are degenerate, stay as they are. The same result every time, in an order of its
/// own.
Scan merge_discs(const Scan& cloud, const MergeConfig& config, MergeCounts* counts = nullptr);

}  // namespace rbvh
