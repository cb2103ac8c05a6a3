// The explicit flatten step: a binary tree becomes nodes of 8 or 16 children for the traversal kernels.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/common/layout.h"

namespace rbvh {

/// Per node `width` values each of lo.x lo.y lo.z hi.x hi.y hi.z (float bits) and child (int): >= 0 a node, <
/// 0 the leaf ~child. An empty slot is a far degenerate box (lo = hi = 1e38) with child INT_MIN: an inverted
/// box would pass a slab test whose bounds are swapped by a negative direction.
struct WideNodes {
  std::vector<std::uint32_t> words;
  std::uint32_t stack_needed = 0;  ///< entries a depth-first traversal can have waiting
};

/// Opens, again and again, the largest inner child until `width` children are found. A tree that is one leaf
/// becomes one node with one child.
WideNodes flatten_wide(const std::vector<RbvhNode>& nodes, std::size_t width);

}  // namespace rbvh
