// Simplified meshes: near the scan, fewer triangles, nothing lost from sight.
#include "pipeline/scan/simplify.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

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

TEST(Simplify, StaysNearTheScan) {
  const Scan ball = bumpy_sphere(80);
  const float diagonal = bounds(ball).diagonal();
  std::size_t before = ball.triangles.size();
  for (const float error : {1e-4f, 1e-3f, 1e-2f}) {
    const Scan fewer = simplify(ball, error * diagonal);
    EXPECT_LT(fewer.triangles.size(), before) << error;
    EXPECT_LT(farthest(ball, fewer), 6 * error * diagonal);
    EXPECT_LT(farthest(fewer, ball), 6 * error * diagonal);
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

/// Flat shaded, so that each face has vertices of its own, and an edge of two colours across flat ground.
TEST(Simplify, CornersKeepTheAttributesOfTheirSide) {
  Scan scan;
  constexpr int n = 24;
  for (const bool right : {false, true}) {
    const auto first = static_cast<std::uint32_t>(scan.positions.size());
    add_sheet(scan, n, [=](float s, float t) {
      const float x = right ? s : s - 1;
      return Vec3f{x, t, 0.001f * std::sin(40 * x) * std::sin(30 * t)};
    });
    scan.colors.resize(scan.positions.size(), right ? Color8{255, 0, 0} : Color8{0, 0, 255});
    scan.normals.resize(scan.positions.size(), right ? Vec3f{0, 0.6f, 0.8f} : Vec3f{0, 0, 1});
    for (std::uint32_t v = first; v < scan.positions.size(); ++v)
      if (scan.positions[v].x == 0) scan.positions[v].z = 0;
  }
  const Scan fewer = simplify(scan, 1e-3f);
  EXPECT_LT(fewer.triangles.size(), scan.triangles.size() / 4);
  for (const Triangle& t : fewer.triangles) {
    const float middle = fewer.positions[t[0]].x + fewer.positions[t[1]].x + fewer.positions[t[2]].x;
    for (const std::uint32_t v : t) {
      EXPECT_EQ(fewer.colors[v][0] != 0, middle > 0);
      EXPECT_EQ(fewer.normals[v].y > 0, middle > 0);
    }
  }
  // No crack along the edge of colours.
  std::map<std::array<float, 3>, std::uint32_t> places;
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const Triangle& t : fewer.triangles) {
    Triangle at{};
    for (std::size_t c = 0; c < 3; ++c) {
      const Vec3f p = fewer.positions[t[c]];
      at[c] = places.try_emplace({p.x, p.y, p.z}, places.size()).first->second;
    }
    for (std::size_t c = 0; c < 3; ++c) ++edges[std::minmax(at[c], at[(c + 1) % 3])];
  }
  for (const auto& [place, number] : places)
    if (place[0] == 0 && place[1] > 0 && place[1] < 1)
      for (const auto& [edge, count] : edges)
        if (edge.first == number || edge.second == number) {
          EXPECT_EQ(count, 2);
        }
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
