// Cleaning by default and on request.
#include "pipeline/scan/clean.h"

#include <gtest/gtest.h>
#include <optional>

#include <random>

#include "pipeline/base/error.h"
#include "pipeline/scan/components.h"
#include "pipeline/scan/ingest.h"
#include "pipeline/scan/outliers.h"
#include "pipeline/scan/thin.h"

namespace rbvh {
namespace {

const float kNan = std::numeric_limits<float>::quiet_NaN();

Scan square() {
  Scan scan;
  scan.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  scan.triangles = {{0, 1, 2}, {0, 2, 3}};
  return scan;
}

TEST(Clean, ACleanScanStaysAsItIs) {
  Scan scan = square();
  scan.object_ids = {3, 4};
  const Scan before = scan;
  const CleanCounts counts = clean(scan);
  EXPECT_EQ(scan.positions, before.positions);
  EXPECT_EQ(scan.triangles, before.triangles);
  EXPECT_EQ(scan.object_ids, before.object_ids);
  EXPECT_EQ(counts.non_finite_vertices + counts.non_finite_faces + counts.duplicate_vertices +
                counts.zero_area_faces + counts.duplicate_faces + counts.unreferenced_vertices,
            0u);
}

TEST(Clean, EachKindOfFaultIsCounted) {
  Scan scan = square();
  scan.positions.insert(scan.positions.begin(), {kNan, 0, 0});  // 0: not finite
  scan.positions.push_back({0, -0.0f, 0});                      // 5: again the corner at 1
  scan.positions.push_back({7, 7, 7});                          // 6: unreferenced
  scan.positions.push_back({0.5f, 0.5f, 0});                    // 7: on the line from 1 to 3
  scan.triangles = {{1, 2, 3}, {5, 3, 4}, {0, 1, 2}, {3, 1, 2}, {1, 3, 2}, {1, 5, 2}, {1, 7, 3}, {1, 2, 3}};
  scan.object_ids = {0, 0, 0, 0, 0, 0, 0, 9};
  scan.properties = {{"number", {0, 1, 2, 3, 4, 1, 6, 7}}};
  const CleanCounts counts = clean(scan);
  EXPECT_EQ(counts.non_finite_vertices, 1u);
  EXPECT_EQ(counts.non_finite_faces, 1u);
  EXPECT_EQ(counts.duplicate_vertices, 1u);
  EXPECT_EQ(counts.zero_area_faces, 2u);
  EXPECT_EQ(counts.duplicate_faces, 1u);  // {3,1,2}; {1,3,2} is the other side, the last another object
  EXPECT_EQ(counts.coincident.pairs(), 1u);
  EXPECT_EQ(counts.unreferenced_vertices, 2u);
  EXPECT_EQ(scan.positions.size(), 4u);
  EXPECT_EQ(scan.properties[0].values, (std::vector<float>{1, 2, 3, 4}));
  EXPECT_EQ(scan.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}, {0, 1, 2}}));
  EXPECT_EQ(scan.object_ids, (std::vector<std::int32_t>{0, 0, 9}));
}

TEST(Clean, PointsThatDifferInAnythingStay) {
  Scan scan;
  scan.positions.assign(6, Vec3f{1, 2, 3});
  scan.colors = {{1, 1, 1}, {1, 1, 1}, {2, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}};
  scan.object_ids = {0, 0, 0, 1, 0, 0};
  scan.properties = {{"intensity", {kNan, kNan, kNan, kNan, 5, kNan}}};
  EXPECT_EQ(clean(scan).duplicate_vertices, 2u);
  EXPECT_EQ(scan.positions.size(), 4u);
  EXPECT_EQ(scan.object_ids, (std::vector<std::int32_t>{0, 0, 1, 0}));
}

// All in one place, but with attributes of their own: must not take quadratic time.
TEST(Clean, ManyPointsAtOnePlace) {
  Scan scan;
  scan.positions.assign(300000, Vec3f{1, 2, 3});
  scan.properties = {{"time", {}}};
  for (int i = 0; i < 300000; ++i) scan.properties[0].values.push_back(static_cast<float>(i));
  EXPECT_EQ(clean(scan).duplicate_vertices, 0u);
}

Scan grid_cloud(int side, float spacing) {
  Scan scan;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      scan.positions.push_back({static_cast<float>(x) * spacing, static_cast<float>(y) * spacing, 0});
  return scan;
}

TEST(Outliers, StrayPointsGo) {
  Scan scan = grid_cloud(30, 1);
  scan.positions.push_back({10, 10, 40});
  scan.positions.push_back({-40, 0, 0});
  EXPECT_EQ(remove_outliers(scan, 8, 3), 2u);
  EXPECT_EQ(scan.positions.size(), 900u);
  Scan two;
  two.positions = {{0, 0, 0}, {1, 0, 0}};
  EXPECT_EQ(remove_outliers(two, 8, 3), 0u);
}

TEST(Thin, OneMeasuredPointAVoxel) {
  Scan scan = grid_cloud(40, 0.25f);
  scan.properties = {{"number", {}}};
  for (std::size_t i = 0; i < scan.positions.size(); ++i)
    scan.properties[0].values.push_back(static_cast<float>(i));
  const Scan before = scan;
  EXPECT_EQ(thin_cloud(scan, 1), 1500u);
  ASSERT_EQ(scan.positions.size(), 100u);
  for (std::size_t i = 0; i < 100; ++i)
    EXPECT_EQ(scan.positions[i], before.positions[static_cast<std::size_t>(scan.properties[0].values[i])]);
  EXPECT_EQ(thin_cloud(scan, 1e-12), 0u);  // 64-bit cells do not overflow
}

TEST(Components, SmallPartsOfAMeshGo) {
  Scan scan = square();
  // The same corner again, as a vertex of its own: connected all the same. And a triangle apart.
  scan.positions.insert(scan.positions.end(),
                        {{1, 1, 0}, {2, 1, 0}, {2, 2, 0}, {9, 9, 9}, {8, 9, 9}, {9, 8, 9}});
  scan.triangles.insert(scan.triangles.end(), {{4, 5, 6}, {7, 8, 9}});
  const ComponentCounts counts = remove_small_components(scan, 0.3);
  EXPECT_EQ(counts.components, 1u);
  EXPECT_EQ(counts.faces, 1u);
  EXPECT_EQ(counts.vertices, 3u);
  EXPECT_EQ(scan.triangles.size(), 3u);
  EXPECT_EQ(remove_small_components(scan, 1.0).components, 0u);
}

TEST(Ingest, SmallPartsOfACloudGo) {
  RawScan raw;
  for (const Vec3f& p : grid_cloud(30, 1).positions) raw.positions.push_back(static_cast<Vec3d>(p));
  for (const Vec3f& p : grid_cloud(5, 1).positions)
    raw.positions.push_back(static_cast<Vec3d>(p) + Vec3d{0, 0, 20});
  IngestReport counts;
  const Scan scan = ingest(std::move(raw), "a", {.min_component = 0.1}, counts);
  EXPECT_EQ(counts.small_components.components, 1u);
  EXPECT_EQ(counts.small_components.vertices, 25u);
  EXPECT_EQ(scan.positions.size(), 900u);
}

std::optional<ErrorKind> ingest_code(RawScan raw, const IngestConfig& config = {}) {
  try {
    IngestReport counts;
    ingest(std::move(raw), "a", config, counts);
  } catch (const Error& error) {
    return error.kind();
  }
  return std::nullopt;
}

TEST(Ingest, NothingUsableIsAnInputError) {
  const double nan = std::nan("");
  RawScan raw;
  raw.positions = {{nan, 0, 0}, {nan, 1, 0}};
  EXPECT_EQ(ingest_code(raw), ErrorKind::kInput);
  raw.positions = {{1, 2, 3}, {1, 2, 3}};
  EXPECT_EQ(ingest_code(raw), ErrorKind::kInput);
  raw.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  raw.triangles = {{0, 1, 2}};
  EXPECT_EQ(ingest_code(raw), ErrorKind::kInput);  // no area
  raw.positions[2] = {0, 1, 0};
  EXPECT_EQ(ingest_code(raw), std::nullopt);  // one triangle is fine
  EXPECT_EQ(ingest_code(raw, {.voxel = 1}), ErrorKind::kUsage);
  EXPECT_EQ(ingest_code(raw, {.viewpoint = Vec3d{}}), ErrorKind::kUsage);
  raw.positions[0].x = nan;
  EXPECT_EQ(ingest_code(raw), ErrorKind::kInput);  // its only face is gone: no cloud of the rest
  raw.triangles.clear();
  EXPECT_EQ(ingest_code(raw), std::nullopt);  // a cloud of two points
}

TEST(Ingest, FlippingTurnsFacesAndNormals) {
  RawScan raw;
  raw.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  raw.normals = {{0, 0, 1}, {0, 0, 0}, {0, 0, 1}};
  raw.triangles = {{0, 1, 2}};
  IngestReport counts;
  const Scan scan = ingest(std::move(raw), "a", {.flip_normals = true}, counts);
  EXPECT_EQ(scan.triangles[0], (Triangle{0, 2, 1}));
  EXPECT_EQ(counts.mesh_normals_completed, 1u);
  EXPECT_EQ(scan.normals[1], (Vec3f{0, 0, -1}));
  EXPECT_DOUBLE_EQ(counts.area, 0.5);
}

}  // namespace
}  // namespace rbvh
