#include "pipeline/measure/surface_distance.h"
#include "pipeline/rbvh/level_surface.h"

#include <gtest/gtest.h>

#include <random>

namespace rbvh {
namespace {

TriangleSoup square(float z, float side = 1) {
  return {{0, 0, z}, {side, 0, z}, {side, side, z}, {0, 0, z}, {side, side, z}, {0, side, z}};
}

TEST(SurfaceDistance, ToEveryPartOfATriangle) {
  const ClosestPoint triangle(TriangleSoup{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}});
  EXPECT_NEAR(triangle.distance({0.5f, 0.5f, 3}), 3, 1e-6);         // inside
  EXPECT_NEAR(triangle.distance({1, -2, 0}), 2, 1e-6);              // first edge
  EXPECT_NEAR(triangle.distance({-2, 1, 0}), 2, 1e-6);              // third edge
  EXPECT_NEAR(triangle.distance({2, 2, 0}), std::sqrt(2.f), 1e-6);  // second edge
  EXPECT_NEAR(triangle.distance({-3, -4, 0}), 5, 1e-6);             // corners
  EXPECT_NEAR(triangle.distance({5, -4, 0}), 5, 1e-6);
  EXPECT_NEAR(triangle.distance({-4, 5, 0}), 5, 1e-6);
  EXPECT_NEAR(triangle.distance({1, 0.5f, 0}), 0, 1e-6);
  EXPECT_TRUE(std::isinf(ClosestPoint(TriangleSoup{}).distance({0, 0, 0})));
}

TEST(SurfaceDistance, ToSlivers) {
  for (const float thin : {1e-2f, 1e-4f, 1e-6f}) {
    const ClosestPoint sliver(TriangleSoup{{0.5f, 0.17505f, -thin}, {0.5f, 0.5f, thin}, {0.5f, -0.5f, thin}});
    EXPECT_LT(sliver.distance({0.5f, 0.075f, 0.2f * thin}), 1e-3f * thin + 3e-7f) << thin;
    EXPECT_NEAR(sliver.distance({0.6f, 0.075f, 0.2f * thin}), 0.1f, 1e-6f) << thin;
  }
}

TEST(SurfaceDistance, TheTreeFindsWhatASearchOfAllFinds) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> place(-1, 1), size(-0.1f, 0.1f);
  TriangleSoup soup;
  for (int i = 0; i < 500; ++i) {
    const Vec3f a{place(random), place(random), place(random)};
    soup.push_back(a);
    for (int k = 0; k < 2; ++k) soup.push_back(a + Vec3f{size(random), size(random), size(random)});
  }
  const ClosestPoint tree(soup);
  for (int i = 0; i < 200; ++i) {
    const Vec3f p{place(random), place(random), place(random)};
    float nearest = std::numeric_limits<float>::infinity();
    for (std::size_t t = 0; t < soup.size(); t += 3)
      nearest =
          std::min(nearest, ClosestPoint(TriangleSoup(soup.begin() + static_cast<std::ptrdiff_t>(t),
                                                      soup.begin() + static_cast<std::ptrdiff_t>(t) + 3))
                                .distance(p));
    EXPECT_FLOAT_EQ(tree.distance(p), nearest);
  }
}

TEST(SurfaceDistance, BetweenSquares) {
  const DistanceStatistics d = sampled_distance(square(0), ClosestPoint(square(0.25f)), 1000);
  EXPECT_NEAR(d.rms, 0.25, 1e-6);
  EXPECT_NEAR(d.max, 0.25, 1e-6);
  // In one direction the larger square extends past the smaller one, in the other it does not.
  const DistanceStatistics past = sampled_distance(square(0, 2), ClosestPoint(square(0)), 20000);
  EXPECT_NEAR(past.max, std::sqrt(2.0), 0.03);
  EXPECT_NEAR(sampled_distance(square(0), ClosestPoint(square(0, 2)), 1000).max, 0, 1e-6);
}

TEST(SurfaceDistance, DiscsAreTheirOctagons) {
  Scan cloud;
  cloud.positions = {{0, 0, 0}, {9, 9, 9}};
  cloud.normals = {{0, 0, 1}, {0, 0, 0}};  // the second has no direction: no surface
  cloud.radii = {2, 1};
  const TriangleSoup soup = surface_of(cloud);
  EXPECT_EQ(soup.size(), 8u * 3);
  for (const Vec3f& corner : soup) {
    EXPECT_NEAR(corner.z, 0, 1e-6);
    EXPECT_LE(length(corner), 2.0001f);
  }
}

// One tile of 3 x 3 texels, a texel being 0.5 wide and a height quantum 0.01, standing at (10, 20, 30).
Level one_tile(std::vector<std::uint16_t> heights) {
  Level level;
  level.atlas_width = level.atlas_height = 3;
  level.layers = {{"height", 1, std::move(heights)}};
  RbvhLeaf leaf{};
  const float rows[3][4] = {{2, 0, 0, -20}, {0, 2, 0, -40}, {0, 0, 100, -3000}};
  for (int i = 0; i < 3; ++i) std::copy(rows[i], rows[i] + 4, leaf.to_tile + 4 * i);
  leaf.width = leaf.height = 3;
  level.leaves = {leaf};
  level.nodes = {{{9, 19, 29}, 0, {12, 22, 999}, 1}};
  return level;
}

TEST(SurfaceDistance, ATilesSurfaceIsItsTexelQuads) {
  const TriangleSoup soup = surface_of(one_tile({100, 100, 100, 100, 100, 100, 100, 100, 100}));
  ASSERT_EQ(soup.size(), 4u * 2 * 3);
  Bounds3f box;
  for (const Vec3f& corner : soup) box.add(corner);
  EXPECT_NEAR(length(box.lo - Vec3f{10, 20, 31}), 0, 1e-4);
  EXPECT_NEAR(length(box.hi - Vec3f{11, 21, 31}), 0, 1e-4);
  EXPECT_NEAR(texel_side(one_tile(std::vector<std::uint16_t>(9, 100))), 0.5, 1e-6);
}

TEST(SurfaceDistance, EmptyTexelsStepsAndWhatLiesOutsideTheBoxAreNoSurface) {
  EXPECT_EQ(surface_of(one_tile({0, 100, 100, 100, 100, 100, 100, 100, 100})).size(), 3u * 2 * 3);
  EXPECT_EQ(surface_of(one_tile({60000, 100, 100, 100, 100, 100, 100, 100, 100})).size(), 3u * 2 * 3);
  Level level = one_tile(std::vector<std::uint16_t>(9, 100));
  level.nodes[0].hi[0] = 10.5f;
  EXPECT_EQ(surface_of(level).size(), 2u * 2 * 3);
}

}  // namespace
}  // namespace rbvh
