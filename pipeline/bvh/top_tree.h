// The tree over finished tiles: binary, by a full-sweep surface-area heuristic over their tight boxes.
#pragma once

#include <vector>

#include "kernels/common/layout.h"
#include "rbvh/geometry.h"

namespace rbvh {

struct TopTree {
  std::vector<RbvhNode> nodes;       ///< see RbvhNode; leaves count in tree order
  std::vector<std::uint32_t> order;  ///< leaf index -> index into the boxes
};

/// No node is deeper than kMaxTopTreeDepth, whatever the boxes.
TopTree build_top_tree(const std::vector<Bounds3f>& boxes);

inline constexpr int kMaxTopTreeDepth = 64;

}  // namespace rbvh
