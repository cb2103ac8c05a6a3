// The hierarchy over a level's leaves, as files store it: binary, by the surface area heuristic.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/rbvh/rbvh.h"
#include "rbvh/geometry.h"

namespace rbvh {

struct LeafHierarchy {
  std::vector<RbvhNode> nodes;       ///< see RbvhNode; leaves count in the hierarchy's order
  std::vector<std::uint32_t> order;  ///< leaf index -> index into the boxes
};

/// No node is deeper than kMaxLeafHierarchyDepth, whatever the boxes; these are finite and not inverted.
/// Nodes are numbered depth first, children in pairs, which the file's codec relies on.
LeafHierarchy build_leaf_hierarchy(std::span<const Bounds3f> boxes);

inline constexpr int kMaxLeafHierarchyDepth = 64;

/// Of the leaves, as the level's nodes have them.
std::vector<Bounds3f> leaf_boxes(const Level& level);

}  // namespace rbvh
