// From a kd-tree to the layouts that its traversals read: small nodes (kd-stack, kd-pushdown), or nodes with
// their cells' boxes and links to their parents (kd-backtrack).
#pragma once

#include <vector>

#include "kernels/bvh/bvh_layout.h"
#include "pipeline/bvh/kd_tree.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

template <class Node>
struct KdLayout {
  BvhRoot scene{};
  std::vector<Node> nodes;                ///< node 0 is the root
  std::vector<BvhTriangle> triangles;     ///< of the scan, at least one
  std::vector<std::uint32_t> references;  ///< to triangles, leaf after leaf; at least one
};

/// `scan` has triangles.
KdLayout<KdCutNode> flatten_kd_cuts(const KdTree& tree, const Scan& scan);
KdLayout<KdCellNode> flatten_kd_cells(const KdTree& tree, const Scan& scan);

}  // namespace rbvh
