// The device's partition against the host's, which shares no code with it: every split of every node, and
// whole trees built independently.
#include "pipeline/rbvh/partition_host.h"

#include <gtest/gtest.h>

#include <map>

#include "pipeline/rbvh/build.h"
#include "tests/exact_scenes.h"
#include "tests/property.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

struct Scene {
  std::string name;
  Scan scan;
  /// Planes pass through vertices and costs are equal by design, so rounding decides often.
  bool regular = false;
};

std::vector<Scene> scenes() {
  Random random(property_seed());
  std::vector<Scene> all;
  all.push_back({"few", soup(random, 7, 0.3f)});
  all.push_back({"soup", soup(random, 6000, 0.05f)});
  all.push_back({"large triangles", soup(random, 3000, 0.8f)});
  all.push_back({"slivers", slivers(random, 3000)});
  all.push_back({"globe", globe(random, 60, 90)});
  all.push_back({"sphere", bumpy_sphere(70), true});
  all.push_back({"plate", grid(64, 0), true});
  all.push_back({"discs", discs(random, 5000, 0.05f)});
  Scene objects{"objects", soup(random, 4000, 0.05f)};
  for (std::size_t i = 0; i < objects.scan.triangles.size(); ++i)
    objects.scan.object_ids.push_back(static_cast<std::int32_t>(i % 3));
  all.push_back(std::move(objects));
  return all;
}

/// The paper's termination (sections 3.1 and 3.4), without the build's floors; `rho` a unit of the scan's
/// area.
bool splits(const PartitionNode& node, double rho, double alpha, double largest_tile) {
  if (node.count() <= 4 || node.objects.count == 2) return node.count() > 1 && node.objects.count == 2;
  const double area = static_cast<double>(node.sums.area),
               projected = static_cast<double>(node.projected_area());
  return projected < alpha * area || rho * area * area > largest_tile * largest_tile * projected;
}

double surface(const PartitionNode& node) {
  return Bounds3d{Vec3d(node.bounds().lo), Vec3d(node.bounds().hi)}.surface_area();
}
double part(const PartitionNode& node) { return surface(node) * static_cast<double>(node.sums.area); }

/// Equation 1 all the way down, over the root's surface: what a ray through the root's box marches.
double tree_cost(const Partition& partition) {
  double cost = 0;
  for (const PartitionNode& node : partition.nodes)
    if (node.left < 0) cost += part(node);
  return cost / surface(partition.nodes[0]);
}

std::vector<std::vector<SplitRequest>> by_depth(const Partition& partition) {
  std::vector<std::vector<SplitRequest>> levels;
  std::vector<std::pair<std::uint32_t, std::size_t>> stack = {{0, 0}};
  while (!stack.empty()) {
    const auto [n, depth] = stack.back();
    stack.pop_back();
    const std::int32_t left = partition.nodes[n].left;
    if (left < 0) continue;
    levels.resize(std::max(levels.size(), depth + 1));
    levels[depth].push_back({n});
    for (std::uint32_t child = 0; child < 2; ++child)
      stack.emplace_back(static_cast<std::uint32_t>(left) + child, depth + 1);
  }
  return levels;
}

/// Which primitives share a leaf with this one: a number for the set.
std::vector<std::uint64_t> leaf_sets(const Partition& partition) {
  const std::vector<std::uint32_t> references = partition.references.read();
  std::vector<std::uint64_t> sets(references.size());
  for (const PartitionNode& node : partition.nodes) {
    if (node.left >= 0) continue;
    std::uint64_t sum = 0;
    for (std::uint32_t i = node.begin; i < node.end; ++i) sum += Random(references[i])();
    for (std::uint32_t i = node.begin; i < node.end; ++i) sets[references[i]] = sum;
  }
  return sets;
}

class HostPartition : public testing::TestWithParam<SplitRule> {};

TEST_P(HostPartition, TheDeviceSplitsEveryNodeAsTheHostDoes) {
  const Device device = Device::open();
  for (const Scene& scene : scenes()) {
    const Primitives primitives = upload_primitives(device, scene.scan);
    Partition partition = make_root(primitives, true, GetParam());
    const double rho = 2e4 / static_cast<double>(partition.nodes[0].sums.area);
    split_nodes(partition, primitives, {0},
                [&](const PartitionNode& node) { return splits(node, rho, 0.85, 30); });
    std::size_t nodes = 0, same = 0;
    for (const std::vector<SplitRequest>& level : by_depth(partition)) {
      Partition host = make_root(primitives, true, GetParam(), PartitionWhere::kHost);
      host.nodes = partition.nodes;
      host.references.copy_from(partition.references, primitives.count);
      split_once(host, primitives, level);
      for (const SplitRequest& request : level) {
        const auto device_left = static_cast<std::size_t>(partition.nodes[request.node].left),
                   host_left = static_cast<std::size_t>(host.nodes[request.node].left);
        double cost[2] = {0, 0};
        bool is_same = true;
        for (const std::size_t side : {0u, 1u}) {
          const PartitionNode &d = partition.nodes[device_left + side], &h = host.nodes[host_left + side];
          cost[0] += part(d);
          cost[1] += part(h);
          is_same = is_same && d.count() == h.count() && d.bounds().lo == h.bounds().lo &&
                    d.bounds().hi == h.bounds().hi;
          if (!is_same) continue;
          const auto area = static_cast<double>(h.sums.area);
          EXPECT_NEAR(static_cast<double>(d.sums.area), area, 1e-5 * area) << scene.name;
          EXPECT_NEAR(static_cast<double>(d.projected_area()), static_cast<double>(h.projected_area()),
                      1e-5 * area)
              << scene.name;
          EXPECT_NEAR(static_cast<double>(d.cone_cosine), static_cast<double>(h.cone_cosine), 1e-4)
              << scene.name;
          EXPECT_EQ(d.objects.count, h.objects.count) << scene.name;
        }
        ++nodes;
        same += is_same;
        // Where the two differ, two candidates cost the same.
        if (GetParam() == SplitRule::kSurfaceArea) {
          EXPECT_NEAR(cost[0], cost[1], 1e-4 * cost[1]) << scene.name;
        }
      }
    }
    EXPECT_GE(static_cast<double>(same + 1), (scene.regular ? 0.8 : 0.97) * static_cast<double>(nodes))
        << scene.name << " of " << nodes;
  }
}

TEST_P(HostPartition, TreesOfBothAreAlike) {
  const Device device = Device::open();
  for (const Scene& scene : scenes()) {
    const Primitives primitives = upload_primitives(device, scene.scan);
    std::map<PartitionWhere, Partition> trees;
    for (const PartitionWhere where : {PartitionWhere::kDevice, PartitionWhere::kHost}) {
      Partition& tree = trees[where] = make_root(primitives, false, GetParam(), where);
      const double rho = 2e4 / static_cast<double>(tree.nodes[0].sums.area);
      split_nodes(tree, primitives, {0},
                  [&](const PartitionNode& node) { return splits(node, rho, 0.85, 30); });
    }
    const Partition &on_device = trees[PartitionWhere::kDevice], &on_host = trees[PartitionWhere::kHost];
    const auto of_nodes = static_cast<double>(on_host.nodes.size());
    EXPECT_NEAR(static_cast<double>(on_device.nodes.size()), of_nodes, 0.01 * of_nodes + 2) << scene.name;
    EXPECT_NEAR(tree_cost(on_device), tree_cost(on_host), 0.01 * tree_cost(on_host)) << scene.name;
    if (scene.regular) continue;
    const std::vector<std::uint64_t> a = leaf_sets(on_device), b = leaf_sets(on_host);
    std::size_t same = 0;
    for (std::size_t i = 0; i < a.size(); ++i) same += a[i] == b[i];
    EXPECT_GE(static_cast<double>(same), 0.98 * static_cast<double>(a.size())) << scene.name;
  }
}

TEST_P(HostPartition, BuildsPairsOfTheSameShape) {
  const Scan scan = bumpy_sphere(80);
  BuildConfig config;
  config.levels = by_density({standard_levels()[3]});
  config.split = GetParam();
  const Device device = Device::open();
  const Rbvh by_device = build_rbvh(device, scan, config);
  config.partition = PartitionWhere::kHost;
  const Rbvh by_host = build_rbvh(device, scan, config);
  const auto leaves = static_cast<double>(by_host.levels[0].leaves.size());
  EXPECT_NEAR(static_cast<double>(by_device.levels[0].leaves.size()), leaves, 0.02 * leaves);
  std::uint32_t primitives = 0;
  for (const RbvhLeaf& leaf : by_host.levels[0].leaves) primitives += leaf.primitives;
  EXPECT_EQ(primitives, scan.triangles.size());
}

TEST(HostPartitionOnly, SplitsByFacingObjectsAndCount) {
  Scan scan;
  add_plate(scan, 10, 0, true);
  add_plate(scan, 10, -0.001f, false);
  const Device device = Device::open();
  Partition sheet =
      make_root(upload_primitives(device, scan), false, SplitRule::kSpatialMedian, PartitionWhere::kHost);
  split_once(sheet, upload_primitives(device, scan), {{0, SplitBy::kFacing, {0, 0, 1}}});
  ASSERT_EQ(sheet.nodes.size(), 3u);
  EXPECT_GT(sheet.nodes[1].sums.area_normal[2], 0.99f);
  EXPECT_LT(sheet.nodes[2].sums.area_normal[2], -0.99f);

  for (Triangle& t : scan.triangles) t = {0, 1, 11};
  const Primitives alike = upload_primitives(device, scan);
  Partition partition = make_root(alike, false, SplitRule::kSurfaceArea, PartitionWhere::kHost);
  split_nodes(partition, alike, {0}, [](const PartitionNode&) { return true; });
  EXPECT_EQ(partition.nodes.size(), 2 * scan.triangles.size() - 1);
}

INSTANTIATE_TEST_SUITE_P(Rules, HostPartition,
                         testing::Values(SplitRule::kSpatialMedian, SplitRule::kSurfaceArea),
                         [](const testing::TestParamInfo<SplitRule>& info) {
                           return info.param == SplitRule::kSpatialMedian ? "Median" : "SurfaceArea";
                         });

}  // namespace
}  // namespace rbvh
