#include "pipeline/rbvh/leaf_hierarchy.h"

#include <algorithm>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/bvh/sah_bvh.h"

namespace rbvh {
namespace {

/// Below this depth sets of leaves are halved: of up to 16 million the deepest lies above
/// kMaxLeafHierarchyDepth.
constexpr int kSahDepth = 40;

}  // namespace

LeafHierarchy build_leaf_hierarchy(std::span<const Bounds3f> boxes) {
  Bvh bvh = build_sah_bvh(boxes, {}, kSahDepth);
  RBVH_CHECK(bvh.order.size() == boxes.size());
  LeafHierarchy result;
  result.order = std::move(bvh.order);
  if (bvh.nodes.empty()) return result;
  result.nodes.reserve(bvh.nodes.size());
  result.nodes.emplace_back();
  std::vector<std::pair<std::uint32_t, std::uint32_t>> open = {{0, 0}};  // the same node there and here
  while (!open.empty()) {
    const auto [from, to] = open.back();
    open.pop_back();
    const BvhNode& node = bvh.nodes[from];
    RbvhNode& stored = result.nodes[to];
    std::copy_n(&node.bounds.lo.x, 3, stored.lo);
    std::copy_n(&node.bounds.hi.x, 3, stored.hi);
    stored.count = node.count;
    stored.first = node.first;
    if (node.count > 0) continue;
    const auto children = static_cast<std::uint32_t>(result.nodes.size());
    stored.first = children;
    result.nodes.resize(children + 2);
    open.push_back({node.first + 1, children + 1});
    open.push_back({node.first, children});
  }
  return result;
}

std::vector<Bounds3f> leaf_boxes(const Level& level) {
  std::vector<Bounds3f> boxes(level.leaves.size());
  for (const RbvhNode& node : level.nodes)
    if (node.count == 1)
      boxes[node.first] = {{node.lo[0], node.lo[1], node.lo[2]}, {node.hi[0], node.hi[1], node.hi[2]}};
  return boxes;
}

}  // namespace rbvh
