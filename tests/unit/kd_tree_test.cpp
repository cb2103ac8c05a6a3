// A kd-tree is whole: a box is in every leaf in whose cell it has a point, and nothing depends on threads.
#include "pipeline/bvh/kd_tree.h"

#include <gtest/gtest.h>

#include "pipeline/base/parallel_for.h"
#include "tests/property.h"

namespace rbvh {
namespace {

bool overlap_inside(const Bounds3f& cell, const Bounds3f& box) {
  for (int axis = 0; axis < 3; ++axis) {
    if (!(box.lo[axis] < cell.hi[axis] && box.hi[axis] > cell.lo[axis])) return false;
  }
  return true;
}

bool touch(const Bounds3f& cell, const Bounds3f& box) {
  for (int axis = 0; axis < 3; ++axis) {
    if (!(box.lo[axis] <= cell.hi[axis] && box.hi[axis] >= cell.lo[axis])) return false;
  }
  return true;
}

/// Checks everything that must hold; returns the number of empty leaves.
std::size_t check(const KdTree& tree, const std::vector<Bounds3f>& boxes, const KdConfig& config) {
  const std::vector<Bounds3f> all_cells = cells(tree);
  std::vector<std::size_t> uses(boxes.size());
  std::size_t empty = 0, references = 0;
  for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
    const KdNode& node = tree.nodes[n];
    const Bounds3f& cell = all_cells[n];
    if (!config.flat_cells && tree.nodes.size() > 1) {
      for (int axis = 0; axis < 3; ++axis) {
        if (tree.bounds.hi[axis] > tree.bounds.lo[axis]) {
          EXPECT_LT(cell.lo[axis], cell.hi[axis]);
        }
      }
    }
    if (node.axis != kKdLeaf) {
      EXPECT_GE(node.position, cell.lo[static_cast<int>(node.axis)]);
      EXPECT_LE(node.position, cell.hi[static_cast<int>(node.axis)]);
      EXPECT_GT(node.first, n);
      continue;
    }
    empty += node.count == 0 ? 1 : 0;
    references += node.count;
    std::vector<bool> here(boxes.size());
    for (std::uint32_t i = 0; i < node.count; ++i) {
      const std::uint32_t id = tree.references[node.first + i];
      EXPECT_FALSE(here[id]);
      here[id] = true;
      ++uses[id];
      EXPECT_TRUE(touch(cell, boxes[id]));
    }
    for (std::size_t id = 0; id < boxes.size(); ++id) {
      if (overlap_inside(cell, boxes[id])) {
        EXPECT_TRUE(here[id]) << "box " << id << " node " << n;
      }
    }
  }
  EXPECT_EQ(references, tree.references.size());
  for (std::size_t id = 0; id < boxes.size(); ++id) EXPECT_GE(uses[id], 1u) << id;
  return empty;
}

TEST(KdTree, EveryBoxIsWhereverItLies) {
  for (const std::size_t count : {1u, 2u, 3u, 50u, 700u}) {
    for (const bool flat : {false, true}) {
      for (const bool flat_cells : {false, true}) {
        SCOPED_TRACE(count);
        const std::vector<Bounds3f> boxes = random_boxes(count, flat, 1);
        KdConfig config;
        config.flat_cells = flat_cells;
        check(build_kd_tree(boxes, config), boxes, config);
      }
    }
  }
}

TEST(KdTree, EmptySpaceIsCutOff) {
  std::vector<Bounds3f> boxes = random_boxes(100, false, 1);
  boxes.push_back({{1000, 1000, 1000}, {1001, 1001, 1001}});
  const KdTree tree = build_kd_tree(boxes, {});
  EXPECT_GT(check(tree, boxes, {}), 0u);
  EXPECT_LT(sah_cost(tree, {}), 0.5 * 1.5 * 101);  // half of a lone leaf's
}

TEST(KdTree, DuplicatesAndBadBoxes) {
  std::vector<Bounds3f> boxes(3000, random_boxes(1, false, 1)[0]);
  check(build_kd_tree(boxes, {}), boxes, {});
  EXPECT_TRUE(build_kd_tree({}, {}).nodes.empty());
  boxes.assign(10, Bounds3f{});
  EXPECT_TRUE(build_kd_tree(boxes, {}).nodes.empty());
}

TEST(KdTree, PlanesFullOfBoxes) {
  // Layers without thickness, which lie in the planes that part them.
  std::vector<Bounds3f> boxes;
  for (int i = 0; i < 400; ++i) {
    const auto x = static_cast<float>(i % 10), y = static_cast<float>(i / 10 % 10),
               z = static_cast<float>(i / 100);
    boxes.push_back({{x, y, z}, {x + 1, y + 1, z}});
  }
  for (const bool flat_cells : {false, true}) {
    KdConfig config;
    config.flat_cells = flat_cells;
    check(build_kd_tree(boxes, config), boxes, config);
  }
}

TEST(KdTree, TheSameForAnyNumberOfThreads) {
  const std::vector<Bounds3f> boxes = random_boxes(100000, false, 1);
  set_thread_count(1);
  const KdTree one = build_kd_tree(boxes, {});
  set_thread_count(3);
  const KdTree three = build_kd_tree(boxes, {});
  set_thread_count(0);
  EXPECT_EQ(one.references, three.references);
  ASSERT_EQ(one.nodes.size(), three.nodes.size());
  for (std::size_t i = 0; i < one.nodes.size(); ++i) {
    ASSERT_EQ(one.nodes[i].first, three.nodes[i].first);
    ASSERT_EQ(one.nodes[i].position, three.nodes[i].position);
  }
}

}  // namespace
}  // namespace rbvh
