// From a binary hierarchy to the layouts that its traversals read: nodes that hold their children's
// boxes (bvh-stack, bvh-trail), or their own and a link to their parent (bvh-parent).
#pragma once

#include <vector>

#include "kernels/bvh/bvh_layout.h"
#include "pipeline/bvh/bvh.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

struct PairLayout {
  BvhRoot scene{};
  std::vector<NodePair> nodes;         ///< inner nodes, at least one
  std::vector<BvhTriangle> triangles;  ///< leaf after leaf, at least one
};

struct ParentLayout {
  BvhRoot scene{};
  std::vector<ParentNode> nodes;
  std::vector<BvhTriangle> triangles;
};

/// `scan` has triangles. Fewer than 2^28 of them (bvh-parent).
PairLayout flatten_bvh_pairs(const Bvh& bvh, const Scan& scan);
ParentLayout flatten_bvh_parents(const Bvh& bvh, const Scan& scan);

/// A triangle that nothing can hit, marked as a leaf's last: an empty tree's only leaf.
BvhTriangle no_triangle();
/// A triangle of the scan, not marked.
BvhTriangle exact_triangle(const Scan& scan, std::uint32_t id);
/// Bounds only.
BvhRoot exact_scene(const Bounds3f& bounds);

}  // namespace rbvh
