#include "pipeline/rbvh/leaf_hierarchy.h"

#include <gtest/gtest.h>

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

bool contains(const RbvhNode& outer, const Bounds3f& inner) {
  bool all = true;
  for (int k = 0; k < 3; ++k) all = all && outer.lo[k] <= inner.lo[k] && inner.hi[k] <= outer.hi[k];
  return all;
}

/// Every box is in exactly one leaf, inside all nodes above it; no node is deeper than allowed.
void check_tree(const std::vector<Bounds3f>& boxes) {
  const LeafHierarchy tree = build_leaf_hierarchy(boxes);
  ASSERT_EQ(tree.order.size(), boxes.size());
  ASSERT_EQ(tree.nodes.size(), 2 * boxes.size() - 1);
  std::vector<int> seen(boxes.size());
  struct Visit {
    std::uint32_t node;
    int depth;
  };
  std::vector<Visit> open = {{0, 0}};
  while (!open.empty()) {
    const Visit v = open.back();
    open.pop_back();
    ASSERT_LE(v.depth, kMaxLeafHierarchyDepth);
    const RbvhNode& node = tree.nodes[v.node];
    if (node.count == 1) {
      ++seen[tree.order[node.first]];
      EXPECT_TRUE(contains(node, boxes[tree.order[node.first]]));
      continue;
    }
    for (const std::uint32_t child : {node.first, node.first + 1}) {
      const RbvhNode& c = tree.nodes[child];
      EXPECT_TRUE(contains(node, {{c.lo[0], c.lo[1], c.lo[2]}, {c.hi[0], c.hi[1], c.hi[2]}}));
      open.push_back({child, v.depth + 1});
    }
  }
  EXPECT_EQ(seen, std::vector<int>(boxes.size(), 1));
}

TEST(LeafHierarchy, HoldsEveryBoxOnce) {
  for (const std::size_t count : {1u, 2u, 3u, 17u, 1000u})
    check_tree(random_boxes(count, property_seed() + count));
}

TEST(LeafHierarchy, StaysShallowWhenBoxesAreEqualOrNested) {
  check_tree(std::vector<Bounds3f>(5000, {{0, 0, 0}, {1, 1, 1}}));
  std::vector<Bounds3f> nested;
  for (int i = 0; i < 120; ++i) {
    const float s = std::ldexp(1.0f, -i);
    nested.push_back({{0, 0, 0}, {s, s, s}});
  }
  check_tree(nested);
}

TEST(LeafHierarchy, OfNothingIsEmpty) { EXPECT_TRUE(build_leaf_hierarchy({}).nodes.empty()); }

}  // namespace
}  // namespace rbvh
