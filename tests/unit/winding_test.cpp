// Faces wound against their neighbours are counted, and turned so that all agree and closed parts face
// outwards.
#include "pipeline/scan/winding.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>

#include "pipeline/scan/ingest.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

TEST(Winding, RandomlyTurnedFacesAreTurnedBack) {
  Scan cube;
  for (unsigned i = 0; i < 8; ++i)
    cube.positions.push_back(
        {static_cast<float>(i & 1), static_cast<float>(i >> 1 & 1), static_cast<float>(i >> 2)});
  cube.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  EXPECT_EQ(count_winding(cube).edges, 18u);
  EXPECT_EQ(count_winding(cube).opposite, 0u);
  for (std::uint32_t seed = 0; seed < 50; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    Scan turned = cube;
    std::size_t count = 0;
    for (Triangle& t : turned.triangles)
      if (random() % 2) {
        std::swap(t[1], t[2]);
        ++count;
      }
    // Two copies: parts are oriented each by itself.
    Scan all = turned;
    for (const Vec3f& p : cube.positions) all.positions.push_back(p + Vec3f{5, 0, 0});
    for (const Triangle& t : cube.triangles) all.triangles.push_back({t[0] + 8, t[2] + 8, t[1] + 8});
    EXPECT_EQ(orient_faces(all).turned, count + 12);
    EXPECT_EQ(count_winding(all).opposite, 0u);
    for (std::size_t f = 0; f < 12; ++f) {
      std::array<Triangle, 2> pair = {all.triangles[f], cube.triangles[f]};
      for (Triangle& t : pair) std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
      EXPECT_EQ(pair[0], pair[1]);
    }
  }
}

TEST(Winding, SeamsOfEqualVerticesJoin) {
  Scan soup;
  const Scan sphere = bumpy_sphere(8);
  for (const Triangle& triangle : sphere.triangles) {
    for (const std::uint32_t corner : triangle) soup.positions.push_back(sphere.positions[corner]);
    const auto at = static_cast<std::uint32_t>(soup.positions.size());
    soup.triangles.push_back({at - 3, at - 2, at - 1});
  }
  EXPECT_EQ(count_winding(soup).edges, count_winding(sphere).edges);
  std::swap(soup.triangles[5][0], soup.triangles[5][1]);
  EXPECT_EQ(count_winding(soup).opposite, 3u);
}

TEST(Winding, AnOpenSheetKeepsTheSideOfMostOfItsArea) {
  Scan scan;
  add_plate(scan, 8, 0.0f);
  const std::vector<Triangle> before = scan.triangles;
  for (std::size_t f = 0; f < 20; ++f) std::swap(scan.triangles[3 * f][0], scan.triangles[3 * f][1]);
  EXPECT_EQ(orient_faces(scan).turned, 20u);
  Vec3d up{};
  for (const Triangle& t : scan.triangles) {
    const Vec3d normal = cross(Vec3d(scan.positions[t[1]]) - Vec3d(scan.positions[t[0]]),
                               Vec3d(scan.positions[t[2]]) - Vec3d(scan.positions[t[0]]));
    EXPECT_GT(normal.z, 0);
    up = up + normal;
  }
  EXPECT_GT(up.z, 0);
}

TEST(Winding, IngestSaysItAndTurnsOnRequest) {
  for (const bool orient : {false, true}) {
    RawScan raw;
    Scan sphere = bumpy_sphere(8);
    orient_faces(sphere);
    for (const Vec3f& p : sphere.positions) raw.positions.push_back(Vec3d(p));
    raw.triangles = sphere.triangles;
    std::swap(raw.triangles[9][0], raw.triangles[9][1]);
    IngestReport counts;
    const Scan scan = ingest(std::move(raw), "", {.orient = orient}, counts);
    EXPECT_EQ(counts.winding.opposite, 3u);
    EXPECT_EQ(counts.winding.turned, orient ? 1u : 0u);
    EXPECT_EQ(count_winding(scan).opposite, orient ? 0u : 3u);
  }
}

}  // namespace
}  // namespace rbvh
