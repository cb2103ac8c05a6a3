// How the host's builders grow a tree from the root down: the top by one thread, whose splits may be shared
// out, then the subtrees below it, each by one thread of its own. Where the one ends and the other begins
// depends on the number of elements alone, so the tree does not depend on the number of threads.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "pipeline/base/parallel_for.h"
#include "pipeline/bvh/bvh.h"
#include "pipeline/bvh/element_box.h"

namespace rbvh {

/// Elements begin .. end - 1 of a builder's own arrays, which are to become a subtree.
struct ElementRange {
  std::size_t begin = 0, end = 0;
  Box bounds;
  Box centers;  ///< of twice the centres, where the builder asks for them
  int depth = 0;
  std::size_t size() const { return end - begin; }
  Bounds3f node_bounds() const { return bounds.bounds(); }
};

template <class Range>
using HalvesOf = std::optional<std::array<Range, 2>>;  ///< nothing: a leaf
using Halves = HalvesOf<ElementRange>;

/// `split(range, parallel)` puts a range's elements in two parts, one behind the other, or makes it a leaf.
/// It may use threads of its own where `parallel` is true. A range has begin, size() and node_bounds().
template <class Range, class Split>
std::vector<BvhNode> grow_bvh(const Range& whole, const Split& split) {
  struct Later {
    Range range;
    std::size_t node;
  };
  // Writes the subtree over `range` into `nodes`, its root at nodes[root]. Sets of at most `stop` elements
  // are put off: appended to `later` together with the node that waits for them.
  const auto grow = [&split](const Range& range, std::size_t root, std::vector<BvhNode>& nodes,
                             std::size_t stop, std::vector<Later>* later) {
    std::vector<Later> stack = {{range, root}};
    while (!stack.empty()) {
      const Later item = stack.back();
      stack.pop_back();
      nodes[item.node].bounds = item.range.node_bounds();
      if (later != nullptr && item.range.size() <= stop) {
        later->push_back(item);
      } else if (const HalvesOf<Range> halves = split(item.range, later != nullptr)) {
        const std::size_t children = nodes.size();
        nodes[item.node].first = static_cast<std::uint32_t>(children);
        nodes.resize(children + 2);
        stack.push_back({(*halves)[1], children + 1});
        stack.push_back({(*halves)[0], children});
      } else {
        nodes[item.node].first = static_cast<std::uint32_t>(item.range.begin);
        nodes[item.node].count = static_cast<std::uint32_t>(item.range.size());
      }
    }
  };
  std::vector<BvhNode> nodes(1);
  std::vector<Later> later;
  grow(whole, 0, nodes, std::max<std::size_t>(4096, whole.size() / 64), &later);
  std::vector<std::vector<BvhNode>> subtrees(later.size());
  parallel_for(later.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      subtrees[i].resize(1);
      grow(later[i].range, 0, subtrees[i], 0, nullptr);
    }
  });
  for (std::size_t i = 0; i < later.size(); ++i) {
    const auto base = static_cast<std::uint32_t>(nodes.size() - 1);  // local node 1 goes to base + 1
    for (BvhNode& node : subtrees[i]) {
      if (node.count == 0) node.first += base;
    }
    nodes[later[i].node] = subtrees[i].front();
    nodes.insert(nodes.end(), subtrees[i].begin() + 1, subtrees[i].end());
    subtrees[i] = {};
  }
  return nodes;
}

}  // namespace rbvh
