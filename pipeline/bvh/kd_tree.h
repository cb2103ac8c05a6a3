// A kd-tree by the surface area heuristic at every plane where a box begins or ends (Wald and Havran, "On
// building fast kd-Trees for Ray Tracing, and on doing that in O(N log N)", RT 2006). Boxes are not clipped
// to their cells, so each axis' events are sorted once and only filtered on the way down. Leaves may be
// empty.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rbvh/geometry.h"

namespace rbvh {

/// Inner: cut at `position` along `axis`, children (below, above) at first and first + 1. Leaf: axis is
/// kKdLeaf, elements references[first] .. references[first + count - 1], perhaps none.
struct KdNode {
  float position = 0;
  std::uint32_t axis = 0, first = 0, count = 0;
};
inline constexpr std::uint32_t kKdLeaf = 3;

struct KdTree {
  Bounds3f bounds;
  std::vector<KdNode> nodes;              ///< node 0 is the root; none when there is no element
  std::vector<std::uint32_t> references;  ///< indices of boxes, leaf after leaf; a box can be in several
};

struct KdConfig {
  /// As the source found best: a high cost of nodes makes wide, shallow trees.
  float traversal_cost = 3.0f;
  float intersection_cost = 1.5f;
  /// What a cut that leaves one side empty costs, of what it would otherwise.
  float empty_factor = 0.8f;
  /// Cells without extent along an axis. Not for a traversal that goes back up by the cells' boxes.
  bool flat_cells = true;
};

/// Nodes from the root to a leaf: at most.
inline constexpr int kMaxKdDepth = 60;

/// Boxes that are empty or not finite are left out. A box with a point inside a cell is in that cell's leaf;
/// one that only touches a cell's face is in one of the two. Does not depend on the number of threads. Any
/// number of boxes below 2^29.
KdTree build_kd_tree(std::span<const Bounds3f> boxes, const KdConfig& config);

/// As sah_cost() of bvh.h.
double sah_cost(const KdTree& tree, const KdConfig& config);

/// The boxes of all nodes' cells.
std::vector<Bounds3f> cells(const KdTree& tree);

}  // namespace rbvh
