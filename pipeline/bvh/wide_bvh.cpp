#include "pipeline/bvh/wide_bvh.h"

#include <algorithm>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/bvh/collapse.h"
#include "pipeline/bvh/sah_binned_bvh.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 14;
constexpr float kFar = 1e38f;

/// A wide node with the boxes of its children; they are still to be linked.
void put_boxes(const Bvh& bvh, const WideChildren& cut, WideNode& node) {
  std::fill_n(&node.planes[0][0], 6 * WIDE_NODE_WIDTH, kFar);
  std::fill_n(node.children, WIDE_NODE_WIDTH, BVH_LEAF_BIT);
  for (std::uint32_t slot = 0; slot < cut.count; ++slot) {
    const Bounds3f& b = bvh.nodes[cut.nodes[slot]].bounds;
    for (int axis = 0; axis < 3; ++axis) {
      node.planes[axis][slot] = b.lo[axis];
      node.planes[axis + 3][slot] = b.hi[axis];
    }
  }
}

}  // namespace

WideBvh widen(const Bvh& bvh, std::vector<std::uint32_t>& leaves) {
  WideBvh wide;
  wide.scene.root = BVH_LEAF_BIT;
  wide.nodes.resize(1);
  put_boxes(bvh, {}, wide.nodes[0]);
  leaves.clear();
  if (bvh.nodes.empty()) return wide;
  const Collapse plan = collapse(bvh, WIDE_NODE_WIDTH);
  struct Open {
    std::uint32_t binary, stack;  ///< stack: entries in use when it is visited
  };
  std::vector<Open> open;  // breadth first: the wide nodes of one depth, from number `first` on
  const auto link_to = [&](std::uint32_t binary, std::uint32_t stack, std::size_t first) {
    if (bvh.nodes[binary].count > 0) {
      leaves.push_back(binary);
      return BVH_LEAF_BIT | static_cast<std::uint32_t>(leaves.size() - 1);
    }
    open.push_back({binary, stack});
    return static_cast<std::uint32_t>(first + open.size() - 1);
  };
  const Bounds3f& b = bvh.nodes[0].bounds;
  for (int axis = 0; axis < 3; ++axis) {
    wide.scene.lo[axis] = b.lo[axis];
    wide.scene.hi[axis] = b.hi[axis];
  }
  wide.scene.root = link_to(0, 0, 0);
  for (std::size_t first = 0; !open.empty();) {
    const std::vector<Open> items = std::exchange(open, {});
    const std::size_t next = first + items.size();
    std::vector<WideChildren> cuts(items.size());
    wide.nodes.resize(next);
    parallel_for(items.size(), kGrain / WIDE_NODE_WIDTH, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        cuts[i] = wide_children(bvh, plan, items[i].binary);
        // The largest first: rays that look for any hit visit them in this order.
        std::stable_sort(cuts[i].nodes, cuts[i].nodes + cuts[i].count, [&](std::uint32_t a, std::uint32_t b) {
          return bvh.nodes[a].bounds.surface_area() > bvh.nodes[b].bounds.surface_area();
        });
        put_boxes(bvh, cuts[i], wide.nodes[first + i]);
      }
    });
    for (std::size_t i = 0; i < items.size(); ++i) {
      const std::uint32_t stack = items[i].stack + cuts[i].count - 1;
      wide.stack = std::max(wide.stack, stack);
      for (std::uint32_t slot = 0; slot < cuts[i].count; ++slot)
        wide.nodes[first + i].children[slot] = link_to(cuts[i].nodes[slot], stack, next);
    }
    first = next;
  }
  return wide;
}

WideBvh widen_elements(const Bvh& bvh) {
  std::vector<std::uint32_t> leaves;
  WideBvh wide = widen(bvh, leaves);
  const auto relink = [&](std::uint32_t& child) {
    const std::uint32_t leaf = child & ~BVH_LEAF_BIT;
    if ((child & BVH_LEAF_BIT) && leaf < leaves.size())
      child = BVH_LEAF_BIT | bvh.order[bvh.nodes[leaves[leaf]].first];
  };
  for (WideNode& node : wide.nodes)
    for (std::uint32_t& child : node.children) relink(child);
  relink(wide.scene.root);
  return wide;
}

WideBvh build_wide_bvh(std::span<const Bounds3f> boxes) {
  return widen_elements(build_sah_binned_bvh(boxes, BvhConfig{}));
}

}  // namespace rbvh
