// A binary bounding volume hierarchy over boxes by the surface area heuristic, binned (Wald, "On fast
// Construction of SAH-based Bounding Volume Hierarchies", RT 2007). Knows boxes only: triangles, discs and
// tiles are all the same.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/base/vec.h"

namespace rbvh {

/// Inner: count == 0, children at first and first + 1. Leaf: elements order[first] .. order[first + count -
/// 1].
struct BvhNode {
  Bounds3f bounds;
  std::uint32_t first = 0, count = 0;
};

struct SahBvh {
  std::vector<BvhNode> nodes;        ///< node 0 is the root; none when there is no element
  std::vector<std::uint32_t> order;  ///< indices of the boxes, leaf after leaf
};

struct SahConfig {
  /// No leaf has more elements, and a set of so few is not split any further.
  std::uint32_t leaf_size = 1;
  /// Elements that a tracer tests at once: the cost of n elements is that of ceil(n / test_width) tests.
  std::uint32_t test_width = 1;
};

/// Boxes that are empty or not finite are left out. The tree does not depend on the number of threads. Any
/// number of boxes below 2^31, with duplicates; the depth stays below 96.
SahBvh build_sah_bvh(std::span<const Bounds3f> boxes, const SahConfig& config);

}  // namespace rbvh
