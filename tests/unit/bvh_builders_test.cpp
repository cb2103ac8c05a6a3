// Every builder's tree is whole, tight and bounded, and the same for any number of threads and on any device.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "pipeline/base/parallel_for.h"
#include "pipeline/bvh/lbvh.h"
#include "pipeline/bvh/ploc.h"
#include "pipeline/bvh/sah_binned_bvh.h"
#include "pipeline/bvh/sah_bvh.h"
#include "pipeline/device/device.h"
#include "tests/property.h"

namespace rbvh {
namespace {

using Build = std::function<Bvh(const std::vector<Bounds3f>&, const BvhConfig&)>;

struct Builder {
  const char* name;
  Build build;
  double most_cost;  ///< of random boxes, relative to the exact sweep's
};

void PrintTo(const Builder& builder, std::ostream* out) { *out << builder.name; }

const Device& device() {
  static const Device device = Device::open();
  return device;
}

/// Runs the code for GPUs, on whatever device there is.
const Device& as_gpu() {
  static const Device gpu = device().as_gpu();
  return gpu;
}

const Builder kBuilders[] = {
    {"sah", [](const auto& boxes, const auto& config) { return build_sah_bvh(boxes, config); }, 1.0},
    {"sah_binned", build_sah_binned_bvh, 1.2},
    {"lbvh", [](const auto& boxes, const auto& config) { return build_lbvh(device(), boxes, config); }, 1.8},
    {"lbvh30",
     [](const auto& boxes, const auto& config) {
       return build_lbvh(device(), boxes, config, MortonBits::k30);
     },
     1.8},
    {"ploc", [](const auto& boxes, const auto& config) { return build_ploc(device(), boxes, config); }, 1.2},
    {"lbvh_gpu", [](const auto& boxes, const auto& config) { return build_lbvh(as_gpu(), boxes, config); },
     1.8},
};

class BvhBuilders : public testing::TestWithParam<Builder> {
 protected:
  Bvh build(const std::vector<Bounds3f>& boxes, const BvhConfig& config) const {
    return GetParam().build(boxes, config);
  }
};

INSTANTIATE_TEST_SUITE_P(All, BvhBuilders, testing::ValuesIn(kBuilders),
                         [](const auto& info) { return std::string(info.param.name); });

/// Checks everything that must hold.
void check(const Bvh& bvh, const std::vector<Bounds3f>& boxes, std::uint32_t leaf_size,
           std::size_t expected) {
  EXPECT_EQ(bvh.order.size(), expected);
  std::vector<std::uint32_t> sorted = bvh.order;
  std::sort(sorted.begin(), sorted.end());
  EXPECT_EQ(std::adjacent_find(sorted.begin(), sorted.end()), sorted.end());
  if (expected == 0) {
    EXPECT_TRUE(bvh.nodes.empty());
    return;
  }
  struct Visit {
    std::uint32_t node;
    int depth;
  };
  std::vector<Visit> stack = {{0, 1}};
  std::size_t elements = 0, visited = 0;
  int deepest = 0;
  while (!stack.empty()) {
    const auto [index, depth] = stack.back();
    stack.pop_back();
    ++visited;
    deepest = std::max(deepest, depth);
    const BvhNode& node = bvh.nodes[index];
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
  EXPECT_LE(deepest, kMaxBvhDepth);
  EXPECT_EQ(deepest, depth(bvh));
}

TEST_P(BvhBuilders, WholeAndTight) {
  for (const std::size_t count : {0u, 1u, 2u, 3u, 8u, 9u, 1000u, 30000u}) {
    for (const bool flat : {false, true}) {
      for (const BvhConfig& config : {BvhConfig{1, 1}, BvhConfig{8, 8}, BvhConfig{8, 1}}) {
        SCOPED_TRACE(count);
        const std::vector<Bounds3f> boxes = random_boxes(count, flat, 0.5f);
        check(build(boxes, config), boxes, config.leaf_size, count);
      }
    }
  }
}

TEST_P(BvhBuilders, CostIsNearTheSweeps) {
  const std::vector<Bounds3f> boxes = random_boxes(20000, false, 0.5f);
  const BvhConfig config{8, 1};
  const double cost = sah_cost(build(boxes, config), config);
  EXPECT_LE(cost, GetParam().most_cost * sah_cost(build_sah_bvh(boxes, config), config));
  // Leaves are merged where that pays, and only there.
  EXPECT_LE(cost, sah_cost(build(boxes, {1, 1}), config));
}

TEST_P(BvhBuilders, DuplicatesAndBadBoxes) {
  std::vector<Bounds3f> boxes(20000, random_boxes(1, false, 0.5f)[0]);
  const Bvh same = build(boxes, {1, 1});
  check(same, boxes, 1, boxes.size());
  EXPECT_LE(depth(same), 17);  // split in halves, not one by one
  boxes.assign(1000, Bounds3f{});
  check(build(boxes, {4, 1}), boxes, 4, 0);
  boxes = random_boxes(1000, false, 0.5f);
  for (std::size_t i = 0; i < boxes.size(); i += 2) boxes[i].hi.y = std::numeric_limits<float>::quiet_NaN();
  boxes[1].lo.x = -std::numeric_limits<float>::infinity();
  check(build(boxes, {4, 1}), boxes, 4, 499);
}

TEST_P(BvhBuilders, DepthStaysBoundedWhereTheHeuristicPeels) {
  // Each box dwarfs the one before: the heuristic splits off one at a time.
  std::vector<Bounds3f> boxes;
  for (int i = -120; i < 120; ++i) {
    const float at = std::ldexp(1.0f, i / 2);
    boxes.push_back({{at, at, at}, {1.1f * at, 1.1f * at, 1.1f * at}});
  }
  check(build(boxes, {1, 1}), boxes, 1, boxes.size());
}

void expect_same(const Bvh& a, const Bvh& b) {
  ASSERT_EQ(a.order, b.order);
  ASSERT_EQ(a.nodes.size(), b.nodes.size());
  for (std::size_t i = 0; i < a.nodes.size(); ++i) {
    ASSERT_EQ(a.nodes[i].first, b.nodes[i].first);
    ASSERT_EQ(a.nodes[i].count, b.nodes[i].count);
    ASSERT_EQ(a.nodes[i].bounds.lo, b.nodes[i].bounds.lo);
  }
}

TEST_P(BvhBuilders, TheSameForAnyNumberOfThreads) {
  const std::vector<Bounds3f> boxes = random_boxes(200000, false, 0.5f);
  set_thread_count(1);
  const Bvh one = build(boxes, {8, 8});
  set_thread_count(3);
  const Bvh three = build(boxes, {8, 8});
  set_thread_count(0);
  expect_same(one, three);
}

TEST(DeviceBuilders, TheSameOnAGpu) {
  const std::vector<Bounds3f> boxes = random_boxes(50000, false, 0.5f);
  expect_same(build_ploc(device(), boxes, {8, 8}), build_ploc(as_gpu(), boxes, {8, 8}));
  expect_same(build_lbvh(device(), boxes, {8, 8}), build_lbvh(as_gpu(), boxes, {8, 8}));
}

}  // namespace
}  // namespace rbvh
