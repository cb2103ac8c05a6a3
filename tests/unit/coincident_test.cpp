// Faces that coincide and face opposite ways.
#include "pipeline/scan/coincident.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "pipeline/scan/clean.h"
#include "pipeline/scan/stitch.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

constexpr FaceFate k = FaceFate::kStays;

Scan tetrahedron() {
  Scan scan;
  scan.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  scan.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return scan;
}

/// A vertex, and the two sides of a face to it from an edge.
void add_fin(Scan& scan, std::uint32_t a, std::uint32_t b, Vec3f tip) {
  const auto c = static_cast<std::uint32_t>(scan.positions.size());
  scan.positions.push_back(tip);
  scan.triangles.push_back({a, b, c});
  scan.triangles.push_back({c, b, a});
}

TEST(Coincident, NothingHappensWhereNothingCoincides) {
  Scan scan = bumpy_sphere(20);
  clean(scan);
  CoincidentCounts counts;
  EXPECT_TRUE(settle_coincident(scan.triangles, scan.positions, {}, 1, counts).empty());
  EXPECT_EQ(counts.pairs(), 0u);
}

TEST(Coincident, ASmallFlapOnAClosedSurfaceGoes) {
  Scan scan = tetrahedron();
  add_fin(scan, 1, 2, {0.505f, 0.505f, 0.005f});
  CoincidentCounts counts;
  const auto fates = settle_coincident(scan.triangles, scan.positions, {}, 10, counts);
  EXPECT_EQ(fates, (std::vector<FaceFate>{k, k, k, k, FaceFate::kGoes, FaceFate::kGoes}));
  EXPECT_EQ(counts.flaps, 1u);
}

TEST(Coincident, ALargeOneIsASheet) {
  Scan scan = tetrahedron();
  add_fin(scan, 1, 2, {2, 2, 2});
  CleanCounts counts = clean(scan);
  EXPECT_EQ(counts.coincident.sheets, 1u);
  ASSERT_EQ(scan.triangles.size(), 5u);
  EXPECT_EQ(scan.triangles.back(), (Triangle{1, 2, 4})) << "the first stays";
}

TEST(Coincident, ASheetThatStandsAloneStaysWithOneSide) {
  Scan scan;
  add_plate(scan, 8, 0);
  const std::size_t count = scan.triangles.size();
  for (std::size_t i = 0; i < count; ++i) {
    const Triangle t = scan.triangles[i];
    scan.triangles.push_back({t[2], t[1], t[0]});
  }
  const CleanCounts counts = clean(scan);
  EXPECT_EQ(counts.coincident.sheets, count);
  EXPECT_EQ(scan.triangles.size(), count);
}

/// Solids that share a face are one closed surface without it.
TEST(Coincident, AMembraneBetweenTwoSolidsGoes) {
  Scan scan = tetrahedron();
  scan.positions.push_back({1, 1, 1});
  for (const Triangle& t : {Triangle{3, 2, 1}, {1, 2, 4}, {2, 3, 4}, {3, 1, 4}}) scan.triangles.push_back(t);
  const auto fates_of = [&](float largest, CoincidentCounts& counts) {
    return settle_coincident(scan.triangles, scan.positions, scan.object_ids, largest, counts);
  };
  CoincidentCounts counts, apart;
  EXPECT_EQ(fates_of(10, counts),
            (std::vector<FaceFate>{k, k, k, FaceFate::kGoes, FaceFate::kGoes, k, k, k}));
  EXPECT_EQ(counts.flaps, 1u);
  // Of two objects each is closed by its own face.
  scan.object_ids = {0, 0, 0, 0, 1, 1, 1, 1};
  EXPECT_TRUE(fates_of(10, apart).empty());
}

/// A pyramid upside down: `faces` x `faces` cells of its lid, which has two sides, then walls to a tip.
Scan pyramid(int faces, bool up_first) {
  Scan scan;
  add_plate(scan, faces, 0);
  const std::vector<Triangle> up = scan.triangles;
  const auto tip = static_cast<std::uint32_t>(scan.positions.size());
  scan.positions.push_back({0, 0, -1});
  std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const Triangle& t : up) edges.insert({{t[0], t[1]}, {t[1], t[2]}, {t[2], t[0]}});
  for (const Triangle& t : up) scan.triangles.push_back({t[2], t[1], t[0]});
  if (!up_first) std::reverse(scan.triangles.begin(), scan.triangles.end());
  for (const auto& [a, b] : edges)
    if (!edges.contains({b, a})) scan.triangles.push_back({b, a, tip});
  return scan;
}

/// Whichever of the two they are, and however large.
TEST(Coincident, TheFacesThatCloseTheSurfaceStay) {
  for (const bool up_first : {true, false})
    for (const int faces : {1, 2, 7, 40}) {
      Scan scan = pyramid(faces, up_first);
      const CleanCounts counts = clean(scan);
      EXPECT_EQ(count_edges(scan).open, 0u) << faces;
      EXPECT_EQ(count_edges(scan).non_manifold, 0u) << faces;
      EXPECT_EQ(counts.coincident.closing, static_cast<std::size_t>(2 * faces * faces));
    }
}

TEST(Coincident, ManyFacesAtOneCornerTakeNoQuadraticTime) {
  Scan scan;
  scan.positions = {{0, 0, 0}};
  constexpr std::uint32_t kCount = 200000;
  for (std::uint32_t i = 0; i < kCount; ++i)
    scan.positions.push_back({1, static_cast<float>(i), static_cast<float>(i) * static_cast<float>(i % 7)});
  for (std::uint32_t i = 1; i < kCount; ++i) {
    scan.triangles.push_back({0, i, i + 1});
    scan.triangles.push_back({0, i + 1, i});
  }
  CoincidentCounts counts;
  settle_coincident(scan.triangles, scan.positions, {}, 1, counts);
  EXPECT_EQ(counts.pairs(), kCount - 1);
}

}  // namespace
}  // namespace rbvh
