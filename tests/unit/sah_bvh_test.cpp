// A hierarchy by the surface area heuristic is whole, tight, bounded, and the same for any number of threads.
#include "pipeline/exact/sah_bvh.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "pipeline/base/parallel_for.h"
#include "tests/property.h"

namespace rbvh {
namespace {

std::vector<Bounds3f> random_boxes(std::size_t count, bool flat) {
  std::mt19937_64 random(property_seed());
  std::uniform_real_distribution<float> place(-10, 10), size(0, 0.5f);
  std::vector<Bounds3f> boxes(count);
  for (Bounds3f& box : boxes) {
    box.add(Vec3f{place(random), place(random), flat ? 1.0f : place(random)});
    box.add(box.lo + Vec3f{size(random), size(random), flat ? 0.0f : size(random)});
  }
  return boxes;
}

struct Shape {
  int depth = 0;
  double sah = 0;  ///< node areas over the root's
};

/// Checks everything that must hold.
Shape check(const SahBvh& bvh, const std::vector<Bounds3f>& boxes, std::uint32_t leaf_size,
            std::size_t expected) {
  Shape shape;
  EXPECT_EQ(bvh.order.size(), expected);
  std::vector<std::uint32_t> sorted = bvh.order;
  std::sort(sorted.begin(), sorted.end());
  EXPECT_EQ(std::adjacent_find(sorted.begin(), sorted.end()), sorted.end());
  if (expected == 0) {
    EXPECT_TRUE(bvh.nodes.empty());
    return shape;
  }
  struct Visit {
    std::uint32_t node;
    int depth;
  };
  std::vector<Visit> stack = {{0, 1}};
  std::size_t elements = 0, visited = 0;
  while (!stack.empty()) {
    const auto [index, depth] = stack.back();
    stack.pop_back();
    ++visited;
    shape.depth = std::max(shape.depth, depth);
    const BvhNode& node = bvh.nodes[index];
    shape.sah += node.bounds.surface_area() / bvh.nodes[0].bounds.surface_area();
    Bounds3f tight;
    if (node.count > 0) {
      EXPECT_LE(node.count, leaf_size);
      for (std::uint32_t i = 0; i < node.count; ++i) tight.add(boxes[bvh.order[node.first + i]]);
      elements += node.count;
    } else {
      tight.add(bvh.nodes[node.first].bounds);
      tight.add(bvh.nodes[node.first + 1].bounds);
      stack.push_back({node.first, depth + 1});
      stack.push_back({node.first + 1, depth + 1});
    }
    EXPECT_EQ(tight.lo, node.bounds.lo);
    EXPECT_EQ(tight.hi, node.bounds.hi);
  }
  EXPECT_EQ(elements, expected);
  EXPECT_EQ(visited, bvh.nodes.size());
  EXPECT_LT(shape.depth, 96);
  return shape;
}

TEST(SahBvh, WholeAndTight) {
  for (const std::size_t count : {0u, 1u, 2u, 3u, 8u, 9u, 1000u, 30000u}) {
    for (const bool flat : {false, true}) {
      for (const std::uint32_t leaf_size : {1u, 8u}) {
        const std::vector<Bounds3f> boxes = random_boxes(count, flat);
        check(build_sah_bvh(boxes, {leaf_size, leaf_size}), boxes, leaf_size, count);
      }
    }
  }
}

TEST(SahBvh, IsMuchBetterThanHalving) {
  // The same boxes in scan order, halved, would have about log2(n) times the root's area a level.
  const std::vector<Bounds3f> boxes = random_boxes(4096, false);
  EXPECT_LT(check(build_sah_bvh(boxes, {1, 1}), boxes, 1, boxes.size()).sah, 0.1 * 4096);
}

TEST(SahBvh, DuplicatesAndBadBoxes) {
  std::vector<Bounds3f> boxes(20000, random_boxes(1, false)[0]);
  check(build_sah_bvh(boxes, {1, 1}), boxes, 1, boxes.size());
  boxes.assign(1000, Bounds3f{});
  check(build_sah_bvh(boxes, {4, 1}), boxes, 4, 0);
  boxes = random_boxes(1000, false);
  for (std::size_t i = 0; i < boxes.size(); i += 2) boxes[i].hi.y = std::numeric_limits<float>::quiet_NaN();
  boxes[1].lo.x = -std::numeric_limits<float>::infinity();
  check(build_sah_bvh(boxes, {4, 1}), boxes, 4, 499);
}

TEST(SahBvh, DepthStaysBoundedWhereTheHeuristicPeels) {
  // Each box dwarfs the one before: the heuristic takes off one at a time.
  std::vector<Bounds3f> boxes;
  for (int i = -120; i < 120; ++i) {
    const float at = std::ldexp(1.0f, i / 2);
    boxes.push_back({{at, at, at}, {1.1f * at, 1.1f * at, 1.1f * at}});
  }
  check(build_sah_bvh(boxes, {1, 1}), boxes, 1, boxes.size());
}

TEST(SahBvh, TheSameForAnyNumberOfThreads) {
  const std::vector<Bounds3f> boxes = random_boxes(200000, false);
  set_thread_count(1);
  const SahBvh one = build_sah_bvh(boxes, {8, 8});
  set_thread_count(3);
  const SahBvh three = build_sah_bvh(boxes, {8, 8});
  set_thread_count(0);
  ASSERT_EQ(one.order, three.order);
  ASSERT_EQ(one.nodes.size(), three.nodes.size());
  for (std::size_t i = 0; i < one.nodes.size(); ++i) {
    ASSERT_EQ(one.nodes[i].first, three.nodes[i].first);
    ASSERT_EQ(one.nodes[i].bounds.lo, three.nodes[i].bounds.lo);
  }
}

}  // namespace
}  // namespace rbvh
