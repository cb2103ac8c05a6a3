#include "pipeline/scan/merge_discs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "pipeline/scan/complete_cloud.h"
#include "tests/bench/vary_scan.h"
#include "tests/property.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

Scan cloud_of(const Scan& mesh, std::size_t points, double noise = 0) {
  Scan cloud = sample_points(mesh, points, property_seed());
  if (noise > 0) add_noise(cloud, noise, property_seed() + 1);
  complete_cloud(cloud, {});
  return cloud;
}

Scan plate(float z = 0, bool up = true) {
  Scan mesh;
  add_plate(mesh, 1, z, up);
  return mesh;
}

void append(Scan& to, const Scan& from) {
  to.positions.insert(to.positions.end(), from.positions.begin(), from.positions.end());
  to.normals.insert(to.normals.end(), from.normals.begin(), from.normals.end());
  to.radii.insert(to.radii.end(), from.radii.begin(), from.radii.end());
}

/// Whether disc `i` covers the point, which lies within `bound` of its plane.
bool covers(const Scan& cloud, std::size_t i, const Vec3f& point, double bound) {
  const Vec3d d = static_cast<Vec3d>(point - cloud.positions[i]), n = static_cast<Vec3d>(cloud.normals[i]);
  const double above = dot(d, n);
  return std::abs(above) <= bound * 1.001 + 1e-6 &&
         length(d - n * above) <= static_cast<double>(cloud.radii[i]) * 1.001 + 1e-6;
}

/// Each centre lies on a merged disc that faces the same way.
void expect_covered(const Scan& cloud, const Scan& merged, double bound) {
  for (std::size_t i = 0; i < cloud.positions.size(); ++i) {
    bool found = false;
    for (std::size_t k = 0; k < merged.positions.size() && !found; ++k)
      found = dot(cloud.normals[i], merged.normals[k]) > 0 && covers(merged, k, cloud.positions[i], bound);
    ASSERT_TRUE(found) << "disc " << i;
  }
}

TEST(MergeDiscs, AFlatPlaneBecomesFewDiscs) {
  const Scan cloud = cloud_of(plate(), 3000);
  MergeCounts counts;
  const Scan merged = merge_discs(cloud, {.bound = 1e-4}, &counts);
  EXPECT_LE(merged.positions.size(), 40u);
  EXPECT_EQ(counts.merged + cloud.positions.size() - counts.discs, merged.positions.size());
  expect_covered(cloud, merged, 1e-4);
  for (const Vec3f& n : merged.normals) EXPECT_GT(n.z, 0.999f);
}

TEST(MergeDiscs, CoverACurvedSurfaceWithinTheBound) {
  const Scan mesh = bumpy_sphere(60);
  for (const double noise : {0.0, 0.003}) {
    const Scan cloud = cloud_of(mesh, 8000, noise);
    std::size_t before = cloud.positions.size();
    for (const double bound : {0.002, 0.01, 0.05}) {
      SCOPED_TRACE(bound);
      const Scan merged = merge_discs(cloud, {.bound = bound});
      EXPECT_LT(merged.positions.size(), before);
      before = merged.positions.size();
      expect_covered(cloud, merged, bound);
    }
    EXPECT_LT(before, cloud.positions.size() / 10);
  }
}

TEST(MergeDiscs, LeaveNoHoleBetweenThem) {
  // Points of the surface between the samples: covered by the discs, so covered by what these become.
  const Scan mesh = bumpy_sphere(60);
  const Scan cloud = cloud_of(mesh, 8000);
  const double bound = 0.01;
  const Scan merged = merge_discs(cloud, {.bound = bound});
  const Scan between = sample_points(mesh, 5000, property_seed() + 2);
  for (const Vec3f& point : between.positions) {
    bool found = false;
    for (std::size_t k = 0; k < merged.positions.size() && !found; ++k)
      found = covers(merged, k, point, 3 * bound);
    ASSERT_TRUE(found);
  }
}

TEST(MergeDiscs, TheTwoSidesOfASheetStayApart) {
  Scan cloud = cloud_of(plate(), 2000);
  append(cloud, cloud_of(plate(-0.001f, false), 2000));
  const Scan merged = merge_discs(cloud, {.bound = 0.01});
  EXPECT_LE(merged.positions.size(), 50u);
  expect_covered(cloud, merged, 0.01);
  for (const Vec3f& n : merged.normals) EXPECT_GT(std::abs(n.z), 0.999f);
}

TEST(MergeDiscs, DepthStepsStaySharp) {
  // Two plates at heights further apart than the bound.
  Scan cloud = cloud_of(plate(), 2000);
  append(cloud, cloud_of(plate(0.1f), 2000));
  const Scan merged = merge_discs(cloud, {.bound = 0.04});
  EXPECT_LT(merged.positions.size(), 400u);
  for (const Vec3f& p : merged.positions) EXPECT_LT(std::min(std::abs(p.z), std::abs(p.z - 0.1f)), 1e-5f);
}

TEST(MergeDiscs, NoDiscSpansAGap) {
  Scan cloud;
  for (int i = 0; i < 40; ++i)
    for (int j = 0; j < 40; ++j) {
      if (i >= 12 && i < 25) continue;
      cloud.positions.push_back({static_cast<float>(i), static_cast<float>(j), 0});
      cloud.normals.push_back({0, 0, 1});
      cloud.radii.push_back(0.8f);
    }
  const Scan merged = merge_discs(cloud, {.bound = 0.1});
  EXPECT_LE(merged.positions.size(), 200u);
  for (std::size_t k = 0; k < merged.positions.size(); ++k)
    EXPECT_FALSE(covers(merged, k, {18, merged.positions[k].y, 0}, 0.1)) << k;
  expect_covered(cloud, merged, 0.1);
}

TEST(MergeDiscs, ObjectsAndColoursStayApart) {
  Scan cloud = cloud_of(plate(), 2000);
  for (const Vec3f& p : cloud.positions) {
    cloud.object_ids.push_back(p.x < 0.1f ? 3 : 7);
    cloud.colors.push_back(p.y < 0 ? Color8{200, 10, 10} : Color8{10, 10, 200});
  }
  const Scan merged = merge_discs(cloud, {.bound = 0.01});
  ASSERT_EQ(merged.object_ids.size(), merged.positions.size());
  ASSERT_EQ(merged.colors.size(), merged.positions.size());
  EXPECT_LT(merged.positions.size(), 400u);
  for (std::size_t k = 0; k < merged.positions.size(); ++k) {
    EXPECT_EQ(merged.object_ids[k], merged.positions[k].x < 0.1f ? 3 : 7);
    EXPECT_EQ(merged.colors[k], merged.positions[k].y < 0 ? (Color8{200, 10, 10}) : (Color8{10, 10, 200}));
  }
}

TEST(MergeDiscs, WeightsByArea) {
  Scan cloud;
  cloud.positions = {{0, 0, 0}, {1, 0, 0}};
  cloud.normals = {{0, 0, 1}, {0, 0, 1}};
  cloud.radii = {1, 2};
  cloud.colors = {{100, 0, 0}, {110, 0, 0}};
  cloud.properties = {{"heat", {10, 20}}};
  const Scan merged = merge_discs(cloud, {.bound = 0.1});
  ASSERT_EQ(merged.positions.size(), 1u);
  EXPECT_NEAR(merged.positions[0].x, 0.8f, 1e-5f);
  EXPECT_NEAR(merged.radii[0], 2.2f, 1e-5f);
  EXPECT_EQ(merged.colors[0][0], 108);
  EXPECT_NEAR(merged.properties[0].values[0], 18, 1e-4f);
}

TEST(MergeDiscs, NoneVanishes) {
  EXPECT_TRUE(merge_discs({}, {.bound = 1}).positions.empty());
  Scan cloud;
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  cloud.positions = {{0, 0, 0}, {100, 0, 0}, {kNan, 0, 0}, {0, 0.1f, 0}, {0, 0.2f, 0}};
  cloud.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 0}, {0, 0, 1}};
  cloud.radii = {1, 1, 1, 1, 0};
  MergeCounts counts;
  const Scan same = merge_discs(cloud, {.bound = 1}, &counts);
  EXPECT_EQ(same.positions.size(), 5u);
  EXPECT_EQ(counts.merged, 0u);
  // All in one place, more than halving by the axis can tell apart.
  cloud = {};
  cloud.positions.assign(1000, {1, 2, 3});
  cloud.normals.assign(1000, {0, 0, 1});
  cloud.radii.assign(1000, 0.5f);
  cloud.normals[7] = {1, 0, 0};
  const Scan merged = merge_discs(cloud, {.bound = 0}, &counts);
  EXPECT_LE(merged.positions.size(), 20u);
  EXPECT_GE(merged.positions.size(), 2u);
}

TEST(MergeDiscs, IsTheSameEveryTime) {
  const Scan cloud = cloud_of(bumpy_sphere(40), 3000, 0.002);
  const Scan a = merge_discs(cloud, {.bound = 0.01}), b = merge_discs(cloud, {.bound = 0.01});
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.normals, b.normals);
  EXPECT_EQ(a.radii, b.radii);
}

}  // namespace
}  // namespace rbvh
