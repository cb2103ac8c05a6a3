// Normals, their orientation, disc radii and areas of clouds.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "pipeline/base/parallel_for.h"
#include "pipeline/scan/complete_cloud.h"
#include "pipeline/scan/neighbors.h"
#include "pipeline/scan/pca.h"
#include "pipeline/scan/radii.h"

namespace rbvh {
namespace {

Scan random_sphere(std::size_t count, Vec3f centre = {}, float noise = 0) {
  std::mt19937 random(7);
  std::normal_distribution<float> normal;
  Scan scan;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f n = normalized(Vec3f{normal(random), normal(random), normal(random)});
    scan.positions.push_back(centre + n * (1 + noise * normal(random)));
  }
  return scan;
}

Scan plane(int width, int height, float dx, float dy, float jitter = 0) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-jitter, jitter);
  Scan scan;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      scan.positions.push_back({dx * (static_cast<float>(x) + uniform(random)),
                                dy * (static_cast<float>(y) + uniform(random)), 0});
  return scan;
}

TEST(Neighbors, AreTheNearestForAnyNumberOfThreads) {
  const Scan scan = random_sphere(3000);
  const Neighbors neighbors = find_neighbors(scan.positions, 8);
  set_thread_count(1);
  const Neighbors again = find_neighbors(scan.positions, 8);
  set_thread_count(0);
  EXPECT_EQ(neighbors.indices, again.indices);
  for (std::size_t i = 0; i < scan.positions.size(); i += 97) {
    std::vector<std::pair<float, std::uint32_t>> all;
    for (std::uint32_t j = 0; j < scan.positions.size(); ++j)
      if (j != i)
        all.push_back({dot(scan.positions[j] - scan.positions[i], scan.positions[j] - scan.positions[i]), j});
    std::sort(all.begin(), all.end());
    const auto found = neighbors.of(i);
    ASSERT_GE(found.size(), 8u);
    for (std::size_t k = 0; k < found.size(); ++k) EXPECT_EQ(found[k], all[k].second);
  }
}

TEST(Neighbors, OfFewEqualAndCollinearPoints) {
  std::vector<Vec3f> points;
  EXPECT_EQ(find_neighbors(points, 8).size(), 0u);
  points = {{1, 2, 3}};
  EXPECT_EQ(find_neighbors(points, 8).of(0).size(), 0u);
  points.assign(50, Vec3f{1, 2, 3});
  const Neighbors equal = find_neighbors(points, 8);
  for (std::uint32_t i = 0; i < 50; ++i) {
    EXPECT_GE(equal.of(i).size(), 8u);
    for (const std::uint32_t j : equal.of(i)) EXPECT_NE(i, j);
  }
  // Ten times denser along the scan lines than across: the neighbourhood grows until it spans two lines.
  const Scan lines = plane(200, 20, 0.1f, 1);
  const Neighbors wide = find_neighbors(lines.positions, 8);
  const std::size_t middle = 10 * 200 + 100;
  EXPECT_GT(wide.of(middle).size(), 8u);
  EXPECT_GT(principal_components(lines.positions, middle, wide.of(middle)).variances[1], 0.01);
}

TEST(Pca, PlanesLinesAndPoints) {
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  for (int trial = 0; trial < 200; ++trial) {
    const Vec3f n = normalized(Vec3f{normal(random), normal(random), normal(random)});
    const Vec3f u = normalized(cross(n, Vec3f{n.y, n.z, n.x})), v = cross(n, u);
    std::vector<Vec3f> points;
    std::vector<std::uint32_t> others;
    for (std::uint32_t i = 0; i < 20; ++i) {
      points.push_back(Vec3f{100, 200, 300} + u * normal(random) + v * normal(random));
      if (i > 0) others.push_back(i);
    }
    const PrincipalComponents plane = principal_components(points, 0, others);
    EXPECT_GT(std::abs(dot(plane.normal, static_cast<Vec3d>(n))), 0.9999);
    for (Vec3f& p : points) p = Vec3f{100, 200, 300} + u * (p.x + p.y - 300);
    const PrincipalComponents line = principal_components(points, 0, others);
    EXPECT_LT(std::abs(dot(line.normal, static_cast<Vec3d>(u))), 1e-2);
    EXPECT_NEAR(length(line.normal), 1, 1e-9);
  }
  const std::vector<Vec3f> same(5, Vec3f{1, 2, 3});
  EXPECT_EQ(principal_components(same, 0, std::vector<std::uint32_t>{1, 2, 3, 4}).normal, (Vec3d{0, 0, 1}));
}

TEST(CompleteCloud, ASphereFacesOutwards) {
  for (const float noise : {0.0f, 0.01f}) {
    Scan scan = random_sphere(20000, {5, 6, 7}, noise);
    const CloudCounts counts = complete_cloud(scan, {});
    EXPECT_EQ(counts.normals_estimated, 20000u);
    EXPECT_EQ(counts.normals_by_viewpoint, 0u);
    EXPECT_EQ(counts.radii_estimated, 20000u);
    std::size_t inward = 0;
    for (std::size_t i = 0; i < scan.positions.size(); ++i) {
      EXPECT_NEAR(length(scan.normals[i]), 1, 1e-5f);
      inward += dot(scan.normals[i], scan.positions[i] - Vec3f{5, 6, 7}) < 0;
    }
    EXPECT_LE(inward, noise > 0 ? 100u : 0u);
  }
}

TEST(CompleteCloud, ABoxWithSharpEdgesFacesOutwards) {
  Scan scan;
  for (int side = 0; side < 6; ++side)
    for (int y = 0; y < 30; ++y)
      for (int x = 0; x < 30; ++x) {
        Vec3f p;
        p[side % 3] = side < 3 ? 0.0f : 30.0f;
        p[(side + 1) % 3] = static_cast<float>(x) + 0.5f;
        p[(side + 2) % 3] = static_cast<float>(y) + 0.5f;
        scan.positions.push_back(p);
      }
  complete_cloud(scan, {});
  for (std::size_t i = 0; i < scan.positions.size(); ++i)
    EXPECT_GT(dot(scan.normals[i], scan.positions[i] - Vec3f{15, 15, 15}), 0) << i;
}

TEST(CompleteCloud, TerrainFacesUp) {
  Scan scan = plane(80, 80, 1, 1, 0.3f);
  for (Vec3f& p : scan.positions) p.z = 3 * std::sin(p.x * 0.2f) * std::cos(p.y * 0.15f);
  complete_cloud(scan, {});
  for (const Vec3f& n : scan.normals) EXPECT_GT(n.z, 0);
}

TEST(CompleteCloud, TheViewpointDecides) {
  Scan scan = random_sphere(5000);
  scan.viewpoints = {{.position = {0, 0, 0}}};  // seen from inside
  const CloudCounts counts = complete_cloud(scan, {});
  EXPECT_EQ(counts.normals_by_viewpoint, 5000u);
  for (std::size_t i = 0; i < 5000; ++i) EXPECT_LT(dot(scan.normals[i], scan.positions[i]), 0);

  Scan other = random_sphere(5000);
  other.viewpoints = {{.position = {0, 0, 0}}};
  complete_cloud(other, {.viewpoint = Vec3d{0, 0, 50}});
  for (std::size_t i = 0; i < 5000; ++i)
    EXPECT_GE(dot(other.normals[i], Vec3f{0, 0, 50} - other.positions[i]), 0);

  // What every writer puts in is no viewpoint where the points cannot have been seen from there.
  Scan terrain = plane(80, 80, 1, 1, 0.3f);
  for (Vec3f& p : terrain.positions) p.z = 0.3f * std::sin(p.x) * std::cos(p.y);
  terrain.viewpoints = {{.position = {-10, -10, 0}, .is_default = true}};
  EXPECT_EQ(complete_cloud(terrain, {}).normals_by_viewpoint, 0u);
}

TEST(CompleteCloud, MergedScansFaceTheirOwnViewpoints) {
  Scan scan = plane(30, 30, 1, 1);
  Scan other = plane(30, 30, 1, 1);
  for (Vec3f& p : other.positions) p.z = 40;
  scan.positions.insert(scan.positions.end(), other.positions.begin(), other.positions.end());
  scan.object_ids.assign(900, 0);
  scan.object_ids.resize(1800, 1);
  scan.viewpoints = {{.position = {15, 15, -100}, .first_object = 0, .last_object = 0},
                     {.position = {15, 15, 100}, .first_object = 1, .last_object = 1}};
  EXPECT_EQ(complete_cloud(scan, {}).normals_by_viewpoint, 1800u);
  EXPECT_LT(scan.normals[450].z, -0.9f);
  EXPECT_GT(scan.normals[1350].z, 0.9f);
}

TEST(CompleteCloud, WhatIsThereStays) {
  Scan scan = plane(20, 20, 1, 1);
  scan.normals.assign(400, Vec3f{0, 0, -1});
  scan.normals[7] = {0, 0, 0};
  scan.radii.assign(400, 5.0f);
  scan.radii[9] = 0;
  scan.positions.push_back({std::nanf(""), 0, 0});
  scan.normals.push_back({1, 0, 0});
  scan.radii.push_back(1);
  const CloudCounts counts = complete_cloud(scan, {});
  EXPECT_EQ(counts.normals_estimated, 1u);
  EXPECT_EQ(counts.radii_estimated, 1u);
  EXPECT_EQ(scan.normals[6], (Vec3f{0, 0, -1}));
  EXPECT_LT(scan.normals[7].z, -0.99f);  // like the others
  EXPECT_EQ(scan.radii[8], 5.0f);
  EXPECT_GT(scan.radii[9], 0.7f);
}

TEST(CompleteCloud, AFewPoints) {
  for (std::size_t count : {1u, 2u, 3u, 4u}) {
    Scan scan;
    for (std::size_t i = 0; i < count; ++i)
      scan.positions.push_back({static_cast<float>(i), static_cast<float>(i % 2), 0});
    complete_cloud(scan, {});
    for (const Vec3f& n : scan.normals) EXPECT_NEAR(length(n), 1, 1e-5f);
    for (const float r : scan.radii) EXPECT_EQ(r > 0, count > 1);
  }
}

/// The largest share of random places inside the plane that no disc covers.
std::size_t uncovered(const Scan& scan, float width, float height) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> u(0.03f * width, 0.97f * width), v(0.03f * height, 0.97f * height);
  std::size_t holes = 0;
  for (int i = 0; i < 3000; ++i) {
    const Vec3f place{u(random), v(random), 0};
    bool covered = false;
    for (std::size_t j = 0; j < scan.positions.size() && !covered; ++j)
      covered = length(scan.positions[j] - place) <= scan.radii[j];
    holes += !covered;
  }
  return holes;
}

TEST(Radii, DiscsCoverTheSurfaceAndAreNoLargerThanThatTakes) {
  struct Case {
    Scan scan;
    float width, height;
    float largest_mean;  ///< radius in units of the spacing
  };
  Scan strewn;
  std::mt19937 random(2);
  std::uniform_real_distribution<float> uniform(0, 50);
  for (int i = 0; i < 2500; ++i) strewn.positions.push_back({uniform(random), uniform(random), 0});
  Case cases[] = {{plane(50, 50, 1, 1), 49, 49, 0.8f},
                  {plane(50, 50, 1, 1, 0.45f), 49, 49, 1.1f},
                  {plane(150, 30, 0.2f, 1), 30, 29, 1.5f},
                  {strewn, 50, 50, 1.3f}};
  for (Case& c : cases) {
    complete_cloud(c.scan, {});
    EXPECT_EQ(uncovered(c.scan, c.width, c.height), 0u);
    double mean = 0;
    for (const float r : c.scan.radii)
      mean += static_cast<double>(r) / static_cast<double>(c.scan.radii.size());
    const double spacing =
        std::sqrt(static_cast<double>(c.width * c.height) / static_cast<double>(c.scan.radii.size()));
    EXPECT_LT(mean, static_cast<double>(c.largest_mean) * spacing);
  }
}

TEST(Radii, AStrayPointIsNoPlate) {
  Scan scan = plane(40, 40, 1, 1);
  scan.positions.push_back({20, 20, 30});
  complete_cloud(scan, {});
  EXPECT_LT(scan.radii.back(), 4.0f);
}

TEST(SurfaceArea, OfACloudIsThatOfTheSurface) {
  const double sphere = 4 * std::numbers::pi;
  Scan scan = random_sphere(30000);
  complete_cloud(scan, {});
  EXPECT_NEAR(surface_area(scan) / sphere, 1, 0.03);
  double squares = 0;
  for (const float r : scan.radii) squares += static_cast<double>(r) * static_cast<double>(r);
  EXPECT_NEAR(squares * std::pow(spacing_per_radius(scan), 2), surface_area(scan), 1e-9);
  for (Scan flat : {plane(200, 200, 1, 1), plane(200, 200, 1, 1, 0.4f), plane(400, 100, 0.25f, 1)}) {
    const Bounds3f box = bounds(flat);
    complete_cloud(flat, {});
    EXPECT_NEAR(surface_area(flat) / static_cast<double>(box.extent().x * box.extent().y), 1, 0.06);
  }
  Scan uncovered;
  uncovered.positions = {{0, 0, 0}};
  EXPECT_EQ(surface_area(uncovered), 0);
  EXPECT_EQ(spacing_per_radius(uncovered), 1);
}

}  // namespace
}  // namespace rbvh
