// Simplified meshes: near the scan, fewer triangles, nothing lost from sight.
#include "pipeline/scan/simplify.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "pipeline/measure/surface_distance.h"
#include "pipeline/scan/closest_point.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

TriangleSoup soup_of(const Scan& scan) {
  TriangleSoup soup;
  for (const Triangle& t : scan.triangles)
    add_triangle(soup, scan.positions[t[0]], scan.positions[t[1]], scan.positions[t[2]]);
  return soup;
}

float farthest(const Scan& from, const Scan& to) {
  const ClosestPoint closest(soup_of(to));
  float most = 0;
  for (const Vec3f& p : from.positions) most = std::max(most, closest.find(p).distance);
  return most;
}

TEST(Simplify, AFlatSheetNeedsFewTriangles) {
  Scan sheet;
  add_sheet(sheet, 40, [](float s, float t) { return Vec3f{s, t, 0}; });
  const Scan fewer = simplify(sheet, 1e-4f);
  EXPECT_LT(fewer.triangles.size(), sheet.triangles.size() / 20);
  EXPECT_LT(farthest(sheet, fewer), 1e-4f);
}

TEST(Simplify, StaysNearTheScanAndUsesItsVertices) {
  const Scan ball = bumpy_sphere(80);
  const float diagonal = bounds(ball).diagonal();
  std::size_t before = ball.triangles.size();
  std::set<std::array<float, 3>> vertices;
  for (const Vec3f& p : ball.positions) vertices.insert({p.x, p.y, p.z});
  for (const float error : {1e-4f, 1e-3f, 1e-2f}) {
    const Scan fewer = simplify(ball, error * diagonal);
    EXPECT_LT(fewer.triangles.size(), before) << error;
    EXPECT_LT(farthest(ball, fewer), 4 * error * diagonal);
    for (const Vec3f& p : fewer.positions) EXPECT_TRUE(vertices.contains({p.x, p.y, p.z}));
    before = fewer.triangles.size();
  }
}

TEST(Simplify, NoErrorChangesNoSurface) {
  const Scan ball = bumpy_sphere(20);
  EXPECT_LT(farthest(ball, simplify(ball, 0)), 1e-6f);
}

TEST(Simplify, SmallComponentsStay) {
  Scan scan = bumpy_sphere(40);
  const std::size_t large = scan.triangles.size();
  // A speck far smaller than the error, and a wire of one triangle.
  const auto first = static_cast<std::uint32_t>(scan.positions.size());
  for (const Vec3f& p : {Vec3f{5, 0, 0}, Vec3f{5.001f, 0, 0}, Vec3f{5, 0.001f, 0}, Vec3f{5, 0, 0.001f}})
    scan.positions.push_back(p);
  scan.triangles.push_back({first, first + 1, first + 2});
  scan.triangles.push_back({first, first + 3, first + 1});
  const auto wire = static_cast<std::uint32_t>(scan.positions.size());
  for (const Vec3f& p : {Vec3f{-5, 0, 0}, Vec3f{-7, 0, 0}, Vec3f{-7, 0.001f, 0}}) scan.positions.push_back(p);
  scan.triangles.push_back({wire, wire + 1, wire + 2});
  const Scan fewer = simplify(scan, 0.5f);
  EXPECT_LT(fewer.triangles.size(), large / 2);
  const auto has_near = [&](float x) {
    return std::any_of(fewer.triangles.begin(), fewer.triangles.end(),
                       [&](const Triangle& t) { return std::abs(fewer.positions[t[0]].x - x) < 0.1f; });
  };
  EXPECT_TRUE(has_near(5));
  EXPECT_TRUE(has_near(-5) || has_near(-7));
}

TEST(Simplify, ObjectsAndAttributesStayApart) {
  Scan scan;
  add_sheet(scan, 10, [](float s, float t) { return Vec3f{s, t, 0}; });
  const std::size_t half = scan.triangles.size();
  add_sheet(scan, 10, [](float s, float t) { return Vec3f{s, t, 1e-6f}; });
  scan.object_ids.assign(scan.triangles.size(), 7);
  std::fill_n(scan.object_ids.begin(), half, 3);
  for (const Vec3f& p : scan.positions)
    scan.colors.push_back(p.z > 0 ? Color8{255, 0, 0} : Color8{0, 0, 255});
  const Scan fewer = simplify(scan, 0.01f);
  ASSERT_EQ(fewer.object_ids.size(), fewer.triangles.size());
  ASSERT_EQ(fewer.colors.size(), fewer.positions.size());
  std::set<std::int32_t> objects(fewer.object_ids.begin(), fewer.object_ids.end());
  EXPECT_EQ(objects, (std::set<std::int32_t>{3, 7}));
  for (std::size_t i = 0; i < fewer.triangles.size(); ++i)
    for (const std::uint32_t corner : fewer.triangles[i])
      EXPECT_EQ(fewer.colors[corner][0] != 0, fewer.object_ids[i] == 7);
}

TEST(Simplify, IsTheSameAgain) {
  const Scan ball = bumpy_sphere(40);
  const Scan a = simplify(ball, 0.01f), b = simplify(ball, 0.01f);
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.triangles, b.triangles);
}

TEST(Simplify, OddInputs) {
  Scan empty;
  EXPECT_TRUE(simplify(empty, 1).triangles.empty());
  Scan one;
  one.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  one.triangles = {{0, 1, 2}};
  EXPECT_EQ(simplify(one, 10).triangles.size(), 1u);
  one.triangles = {{0, 1, 2}, {0, 0, 1}, {2, 1, 0}};
  EXPECT_GE(simplify(one, 10).triangles.size(), 1u);
}

}  // namespace
}  // namespace rbvh
