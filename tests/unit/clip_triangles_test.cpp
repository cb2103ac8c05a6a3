// Triangles cut at boxes: nothing is lost, and no gap opens.
#include "pipeline/rbvh/clip_triangles.h"

#include <gtest/gtest.h>

#include <map>
#include <random>

#include "tests/property.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

double area_of(const Scan& mesh, const Triangle& t) {
  const Vec3d a(mesh.positions[t[0]]);
  return 0.5 * length(cross(Vec3d(mesh.positions[t[1]]) - a, Vec3d(mesh.positions[t[2]]) - a));
}

double area_of(const Scan& mesh) {
  double area = 0;
  for (const Triangle& t : mesh.triangles) area += area_of(mesh, t);
  return area;
}

Bounds3d random_box(std::mt19937_64& random, double most) {
  std::uniform_real_distribution<double> place(-1.1, 1.1), size(0.01, most);
  const Vec3d center{place(random), place(random), place(random)},
      half{size(random), size(random), size(random)};
  return {center - half, center + half};
}

/// Ends of the edges that one triangle has, by place: vertices of sheets meet without being one.
std::vector<std::pair<Vec3f, Vec3f>> open_edges(const Scan& mesh) {
  using Place = std::array<float, 3>;
  std::map<std::pair<Place, Place>, int> counts;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto place = [&](std::uint32_t v) {
        const Vec3f p = mesh.positions[v];
        return Place{p.x + 0.0f, p.y + 0.0f, p.z + 0.0f};
      };
      const Place a = place(t[k]), b = place(t[(k + 1) % 3]);
      if (a != b) counts[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
    }
  std::vector<std::pair<Vec3f, Vec3f>> open;
  for (const auto& [edge, count] : counts)
    if (count != 0)
      open.push_back(
          {{edge.first[0], edge.first[1], edge.first[2]}, {edge.second[0], edge.second[1], edge.second[2]}});
  return open;
}

bool is_on_surface(const Bounds3d& box, Vec3f p) {
  constexpr double kRounding = 1e-6;
  const Vec3d q(p), margin{kRounding, kRounding, kRounding};
  return contains({box.lo - margin, box.hi + margin}, q) && !contains({box.lo + margin, box.hi - margin}, q);
}

/// A closed mesh: the sphere's seam and poles are vertices at equal places.
Scan closed_sphere(int n) {
  Scan scan = bumpy_sphere(n);
  const auto side = static_cast<std::uint32_t>(n) + 1;
  for (std::uint32_t j = 0; j < side; ++j) scan.positions[j * side + side - 1] = scan.positions[j * side];
  for (std::uint32_t i = 0; i < side; ++i) {
    scan.positions[i] = scan.positions[0];
    scan.positions[(side - 1) * side + i] = scan.positions[(side - 1) * side];
  }
  return scan;
}

TEST(ClipTriangles, NothingIsLostAndGapsAreTheBoxesOwn) {
  std::mt19937_64 random(property_seed());
  ASSERT_TRUE(open_edges(closed_sphere(13)).empty());
  for (int round = 0; round < 300; ++round) {
    const Scan scan = closed_sphere(4 + round % 20);
    const Bounds3d box = random_box(random, round % 3 == 0 ? 0.05 : 0.9);
    Scan inside = scan, outside = scan;
    const auto from_inside = clip_triangles(inside, box, BoxSide::kInside, {}),
               from_outside = clip_triangles(outside, box, BoxSide::kOutside, {});
    ASSERT_EQ(from_inside.size(), inside.triangles.size());
    ASSERT_EQ(from_outside.size(), outside.triangles.size());
    EXPECT_TRUE(std::is_sorted(from_outside.begin(), from_outside.end()));
    std::vector<double> areas(scan.triangles.size());
    for (std::size_t i = 0; i < areas.size(); ++i) areas[i] = -area_of(scan, scan.triangles[i]);
    for (std::size_t i = 0; i < from_inside.size(); ++i)
      areas[from_inside[i]] += area_of(inside, inside.triangles[i]);
    for (std::size_t i = 0; i < from_outside.size(); ++i)
      areas[from_outside[i]] += area_of(outside, outside.triangles[i]);
    for (const double area : areas) ASSERT_NEAR(area, 0, 1e-6) << round;
    for (const Scan* part : {&inside, &outside})
      for (const auto& [a, b] : open_edges(*part)) {
        ASSERT_TRUE(is_on_surface(box, a)) << round << ": " << a.x << " " << a.y << " " << a.z;
        ASSERT_TRUE(is_on_surface(box, b)) << round;
      }
  }
}

TEST(ClipTriangles, AHoleInsideOfATriangle) {
  Scan scan;
  scan.positions = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}};
  scan.triangles = {{0, 1, 2}};
  Scan outside = scan;
  clip_triangles(outside, {{1, 1, -1}, {1.5, 1.5, 1}}, BoxSide::kOutside, {});
  EXPECT_NEAR(area_of(outside), 8 - 0.25, 1e-6);
  EXPECT_EQ(outside.positions.size(), 7u);
  Scan inside = scan;
  clip_triangles(inside, {{1, 1, -1}, {1.5, 1.5, 1}}, BoxSide::kInside, {});
  EXPECT_NEAR(area_of(inside), 0.25, 1e-6);
}

TEST(ClipTriangles, AttributesAreThoseOfThePlace) {
  Scan scan;
  scan.positions = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}};
  scan.triangles = {{0, 1, 2}};
  scan.colors = {{0, 0, 0}, {200, 0, 0}, {0, 100, 0}};
  scan.properties = {{"x", {0, 2, 0}}};
  scan.object_ids = {7};
  scan.face_textures = {{0, {{{0, 0}, {1, 0}, {0, 1}}}}};
  clip_triangles(scan, {{-1, -1, -1}, {1, 3, 1}}, BoxSide::kInside, {});
  ASSERT_EQ(scan.positions.size(), 5u);
  for (std::size_t i = 0; i < scan.positions.size(); ++i) {
    EXPECT_NEAR(scan.properties[0].values[i], scan.positions[i].x, 1e-6);
    EXPECT_NEAR(scan.colors[i][0], 100 * scan.positions[i].x, 1);
    EXPECT_NEAR(scan.colors[i][1], 50 * scan.positions[i].y, 1);
  }
  ASSERT_EQ(scan.object_ids.size(), scan.triangles.size());
  ASSERT_EQ(scan.face_textures.size(), scan.triangles.size());
  for (std::size_t i = 0; i < scan.triangles.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_NEAR(scan.face_textures[i].corners[k][0], 0.5f * scan.positions[scan.triangles[i][k]].x, 1e-6);
}

TEST(ClipTriangles, NewVerticesLieOnTheLattice) {
  Scan scan = closed_sphere(12);
  const std::size_t before = scan.positions.size();
  const Lattice lattice{{-2, -2, -2}, 0.01f};
  clip_triangles(scan, {{-0.3, -0.2, -2}, {0.4, 0.5, 2}}, BoxSide::kOutside, lattice);
  ASSERT_GT(scan.positions.size(), before);
  for (std::size_t i = before; i < scan.positions.size(); ++i)
    for (int axis = 0; axis < 3; ++axis) {
      const float at = (scan.positions[i][axis] + 2) / 0.01f;
      EXPECT_NEAR(at, std::round(at), 1e-3);
    }
}

}  // namespace
}  // namespace rbvh
