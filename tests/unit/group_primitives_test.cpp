// The leaves of a level that holds primitives.
#include "pipeline/rbvh/group_primitives.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "pipeline/rbvh/leaf_primitives.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

/// Every primitive is in one group; no group is too large or of two objects.
void expect_groups(const Scan& scan, const RefinedLevel& groups) {
  const std::size_t count = scan.is_cloud() ? scan.positions.size() : scan.triangles.size();
  std::set<std::uint32_t> seen;
  ASSERT_EQ(groups.held.size(), groups.tiles.size());
  for (std::size_t k = 0; k < groups.held.size(); ++k) {
    EXPECT_EQ(groups.tiles[k].decision, LeafDecision::kPrimitives);
    EXPECT_EQ(groups.tiles[k].leaf.primitives, groups.held[k].size());
    EXPECT_LE(groups.held[k].size(), kMostLeafPrimitives);
    for (const std::uint32_t i : groups.held[k]) {
      EXPECT_TRUE(seen.insert(i).second) << i;
      const std::int32_t object = scan.object_ids.empty() ? 0 : scan.object_ids[i];
      EXPECT_EQ(groups.tiles[k].leaf.object_id, static_cast<std::uint32_t>(object));
    }
  }
  EXPECT_EQ(seen.size(), count);
}

TEST(GroupPrimitives, AllAreInOneLeafEach) {
  const Scan scan = bumpy_sphere(60);
  const RefinedLevel groups = group_primitives(scan, {});
  expect_groups(scan, groups);
  // Not much smaller than they may be: each takes bytes of its own in the file.
  EXPECT_LT(groups.held.size(), scan.triangles.size() / (kMostLeafPrimitives / 4));
}

TEST(GroupPrimitives, ObjectsStayApartEvenWhereTheyCoincide) {
  Scan scan = bumpy_sphere(20);
  const std::size_t count = scan.triangles.size();
  for (std::size_t i = 0; i < count; ++i) scan.triangles.push_back(Triangle(scan.triangles[i]));
  for (std::size_t i = 0; i < 2 * count; ++i) scan.object_ids.push_back(i < count ? 7 : 3);
  expect_groups(scan, group_primitives(scan, {}));
}

TEST(GroupPrimitives, OneSidedLeavesFaceOneWay) {
  // A coarse, thin shell: what is inside faces the other way, and leaves would reach around.
  Scan scan = bumpy_sphere(8);
  const std::size_t vertices = scan.positions.size(), count = scan.triangles.size();
  for (std::size_t i = 0; i < vertices; ++i) scan.positions.push_back(scan.positions[i] * 0.99f);
  for (std::size_t i = 0; i < count; ++i) {
    const auto [a, b, c] = scan.triangles[i];
    const auto inner = [&](std::uint32_t v) { return static_cast<std::uint32_t>(v + vertices); };
    scan.triangles.push_back({inner(a), inner(c), inner(b)});
  }
  scan.normals.clear();
  const auto normal = [&](std::uint32_t i) {
    const auto [a, b, c] = scan.triangles[i];
    return cross(scan.positions[b] - scan.positions[a], scan.positions[c] - scan.positions[a]);
  };
  const auto facing_away = [&](const RefinedLevel& groups) {
    std::size_t away = 0;
    for (const auto& held : groups.held) {
      Vec3f mean{};
      for (const std::uint32_t i : held) mean = mean + normal(i);
      for (const std::uint32_t i : held) away += dot(normal(i), mean) < 0;
    }
    return away;
  };
  EXPECT_GT(facing_away(group_primitives(scan, {})), 0u);
  const RefinedLevel one_sided = group_primitives(scan, {}, true);
  expect_groups(scan, one_sided);
  EXPECT_EQ(facing_away(one_sided), 0u);
}

TEST(GroupPrimitives, OneIsEnough) {
  Scan scan;
  scan.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  scan.triangles = {{0, 1, 2}};
  expect_groups(scan, group_primitives(scan, {}));
}

}  // namespace
}  // namespace rbvh
