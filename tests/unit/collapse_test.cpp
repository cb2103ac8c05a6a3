#include "pipeline/bvh/collapse.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/bvh/sah_bvh.h"
#include "pipeline/bvh/wide_bvh.h"
#include "tests/property.h"

namespace rbvh {
namespace {

std::vector<Bounds3f> random_boxes(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<float> at(-1, 1), size(0, 0.1f);
  std::vector<Bounds3f> boxes(count);
  for (Bounds3f& b : boxes) {
    const Vec3f p{at(random), at(random), at(random)};
    b = {p, p + Vec3f{size(random), size(random), size(random)}};
  }
  return boxes;
}

/// Every inner node's left child is a leaf.
Bvh make_chain(std::uint32_t leaves) {
  Bvh bvh;
  const auto box = [](std::uint32_t size) { return Bounds3f{{0, 0, 0}, {static_cast<float>(size), 1, 1}}; };
  bvh.nodes.push_back({box(leaves), 0, 0});
  for (std::uint32_t i = 0; i < leaves; ++i) bvh.order.push_back(i);
  std::uint32_t last = 0;
  for (std::uint32_t i = 0; i + 1 < leaves; ++i) {
    const auto first = static_cast<std::uint32_t>(bvh.nodes.size());
    bvh.nodes[last].first = first;
    bvh.nodes.push_back({box(1), i, 1});
    bvh.nodes.push_back({box(leaves - i - 1), 0, 0});
    last = first + 1;
  }
  bvh.nodes[last].first = leaves - 1;
  bvh.nodes[last].count = 1;
  return bvh;
}

struct Widened {
  double cost = 0;        ///< summed surface area of the wide nodes
  std::vector<int> seen;  ///< by place in the order
  std::size_t nodes = 0;
};

/// `children(node)`: of a wide node, binary nodes.
template <class Children>
Widened widened(const Bvh& bvh, const Children& children) {
  Widened result;
  result.seen.resize(bvh.order.size());
  std::vector<std::uint32_t> open = {0};
  while (!open.empty()) {
    const std::uint32_t at = open.back();
    open.pop_back();
    const BvhNode& node = bvh.nodes[at];
    if (node.count > 0) {
      for (std::uint32_t i = 0; i < node.count; ++i) ++result.seen[node.first + i];
      continue;
    }
    result.cost += static_cast<double>(node.bounds.surface_area());
    ++result.nodes;
    for (const std::uint32_t child : children(at)) open.push_back(child);
  }
  return result;
}

/// Opens, again and again, the largest inner child.
std::vector<std::uint32_t> greedy_children(const Bvh& bvh, std::uint32_t node, std::size_t width) {
  std::vector<std::uint32_t> children = {node};
  while (children.size() < width) {
    std::size_t widest = children.size();
    float largest = -1;
    for (std::size_t k = 0; k < children.size(); ++k) {
      const BvhNode& child = bvh.nodes[children[k]];
      if (child.count > 0 || child.bounds.surface_area() <= largest) continue;
      largest = child.bounds.surface_area();
      widest = k;
    }
    if (widest == children.size()) break;
    const std::uint32_t first = bvh.nodes[children[widest]].first;
    children[widest] = first;
    children.push_back(first + 1);
  }
  return children;
}

void check_collapse(const Bvh& bvh, std::uint32_t width) {
  const Collapse plan = collapse(bvh, width);
  const Widened best = widened(bvh, [&](std::uint32_t node) {
    const WideChildren children = wide_children(bvh, plan, node);
    EXPECT_GE(children.count, 2u);
    EXPECT_LE(children.count, width);
    return std::vector<std::uint32_t>(children.nodes, children.nodes + children.count);
  });
  EXPECT_EQ(best.seen, std::vector<int>(bvh.order.size(), 1));
  EXPECT_NEAR(best.cost, plan.cost, 1e-4 * best.cost);
  const Widened greedy = widened(bvh, [&](std::uint32_t node) { return greedy_children(bvh, node, width); });
  EXPECT_LE(best.cost, greedy.cost * (1 + 1e-5));
}

TEST(Collapse, CostsNoMoreThanGreedyOpeningAndKeepsEveryLeaf) {
  for (const std::uint32_t width : {2u, 8u, 16u}) {
    for (const std::size_t count : {1u, 2u, 3u, 9u, 16u, 17u, 300u, 5000u})
      check_collapse(build_sah_bvh(random_boxes(count, property_seed() + count), {}), width);
    for (const std::uint32_t leaves : {2u, 16u, 17u, 500u}) check_collapse(make_chain(leaves), width);
    // Equal boxes, and boxes without extent.
    check_collapse(build_sah_bvh(std::vector<Bounds3f>(200, {{0, 0, 0}, {1, 1, 1}}), {}), width);
    check_collapse(build_sah_bvh(std::vector<Bounds3f>(200, {{1, 1, 1}, {1, 1, 1}}), {}), width);
  }
}

TEST(Collapse, OfNothingIsEmpty) { EXPECT_TRUE(collapse({}, 16).choices.empty()); }

TEST(Collapse, FillsNodesWhoseBoxesAreAllAlike) {
  // 256 leaves fit 17 nodes of 16.
  const Bvh bvh = build_sah_bvh(std::vector<Bounds3f>(256, {{0, 0, 0}, {1, 1, 1}}), {});
  EXPECT_EQ(widen_elements(bvh).nodes.size(), 17u);
}

TEST(WideBvh, ReachesEveryLeafOnceAndBoundsTheStack) {
  for (const std::size_t count : {0u, 1u, 2u, 9u, 300u}) {
    const WideBvh wide = build_wide_bvh(random_boxes(count, property_seed() + count));
    std::vector<int> seen(count);
    std::vector<std::uint32_t> stack = {wide.scene.root};
    std::size_t deepest = 0;
    while (!stack.empty()) {
      const std::uint32_t at = stack.back();
      stack.pop_back();
      if (at & BVH_LEAF_BIT) {
        if (count > 0) ++seen.at(at & ~BVH_LEAF_BIT);
        continue;
      }
      const WideNode& node = wide.nodes.at(at);
      for (std::size_t k = 0; k < WIDE_NODE_WIDTH; ++k) {
        const bool is_unused = node.planes[0][k] == 1e38f;
        for (std::size_t axis = 0; axis < 3; ++axis)
          EXPECT_EQ(node.planes[axis][k] == node.planes[axis + 3][k] && is_unused, is_unused);
        if (!is_unused) stack.push_back(node.children[k]);
      }
      deepest = std::max(deepest, stack.size() - 1);  // the nearest child is not put on the stack
    }
    EXPECT_EQ(seen, std::vector<int>(count, 1));
    EXPECT_LE(deepest, wide.stack);
  }
}

}  // namespace
}  // namespace rbvh
