// A tile's guests: primitives of its neighbours that reach into it. Rasterised at its rim, they make
// neighbouring tiles agree on the surface between them, where a tile alone could only guess by extrapolation.
// They take the place of the paper's overlap of 5 % a split, which multiplies the references.
#pragma once

#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/rbvh/partition.h"
#include "pipeline/rbvh/primitives.h"

namespace rbvh {

/// The guests of query k: primitives[firsts[k], firsts[k + 1]).
struct Overlaps {
  std::vector<std::uint32_t> firsts;
  Buffer<std::uint32_t> primitives;
};

Overlaps find_overlaps(const Partition& partition, const Primitives& primitives,
                       const std::vector<OverlapQuery>& queries);

}  // namespace rbvh
