// Overlapping neighbours: the primitives of other tiles that overlap a tile's box. tile_border.h says what
// for.
#pragma once

#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/rbvh/partition.h"
#include "pipeline/rbvh/primitives.h"

namespace rbvh {

/// Those of query k: primitives[firsts[k], firsts[k + 1]).
struct Overlaps {
  std::vector<std::uint32_t> firsts;
  Buffer<std::uint32_t> primitives;
};

Overlaps find_overlaps(const Partition& partition, const Primitives& primitives,
                       const std::vector<OverlapQuery>& queries);

}  // namespace rbvh
