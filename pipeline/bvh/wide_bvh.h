// From a binary hierarchy to the wide one that kernels traverse (kernels/bvh/wide_node.h): nodes of 16
// children.
#pragma once

#include <span>
#include <vector>

#include "kernels/bvh/bvh_layout.h"
#include "pipeline/bvh/bvh.h"

namespace rbvh {

/// A child, or the root, that is a leaf: BVH_LEAF_BIT | its number. An unused slot is a box far away.
struct WideBvh {
  BvhRoot scene{};
  std::vector<WideNode> nodes;  ///< at least one
  std::uint32_t stack = 1;      ///< entries that a traversal can need at most
};

/// Widens by surface-area-optimal collapse (collapse.h). A leaf's number is its place in `leaves`, which gets
/// the binary tree's leaves.
WideBvh widen(const Bvh& bvh, std::vector<std::uint32_t>& leaves);

/// The same for a tree whose leaves hold one element each: a leaf's number is the element's.
WideBvh widen_elements(const Bvh& bvh);

/// A hierarchy over boxes: a leaf's number is the box's.
WideBvh build_wide_bvh(std::span<const Bounds3f> boxes);

}  // namespace rbvh
