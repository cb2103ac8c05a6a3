#include "pipeline/measure/fidelity.h"

#include <gtest/gtest.h>

#include <limits>
#include <numeric>

namespace rbvh {
namespace {

constexpr std::uint32_t kSize = 32;
constexpr float kDiagonal = 10;

const Hit kMiss{std::numeric_limits<float>::infinity(), {0, 0, 0}, 0, 0, RBVH_NO_LEAF, 0};
Hit hit_at(float t) { return {t, {0, 0, 1}, 0, 0, 0, 0}; }

// A picture of a square object at depth 5, rows and columns 8 to 23.
std::vector<Hit> square() {
  std::vector<Hit> hits(kSize * kSize, kMiss);
  for (std::uint32_t y = 8; y < 24; ++y)
    for (std::uint32_t x = 8; x < 24; ++x) hits[y * kSize + x] = hit_at(5);
  return hits;
}
Hit& pixel(std::vector<Hit>& hits, std::uint32_t x, std::uint32_t y) { return hits[y * kSize + x]; }
HitFidelity compare(const std::vector<Hit>& exact, const std::vector<Hit>& level) {
  return compare_hits(exact, level, kSize, kSize, kDiagonal);
}

TEST(Fidelity, EqualPicturesHaveNoError) {
  const HitFidelity f = compare(square(), square());
  EXPECT_EQ(f.pixels, 256u);
  EXPECT_EQ(f.holes + f.leaks + f.walls + f.mismatches, 0u);
  EXPECT_EQ(f.dt.max, 0);
  EXPECT_EQ(f.normal_degrees.max, 0);
}

TEST(Fidelity, FindsHolesLeaksAndWallsInside) {
  std::vector<Hit> level = square();
  pixel(level, 10, 10) = kMiss;
  pixel(level, 12, 12) = hit_at(5.11f);  // over 1% of the diagonal behind
  pixel(level, 14, 14) = hit_at(4.89f);
  pixel(level, 16, 16) = hit_at(5.09f);  // within
  const HitFidelity f = compare(square(), level);
  EXPECT_EQ(f.holes, 1u);
  EXPECT_EQ(f.leaks, 1u);
  EXPECT_EQ(f.walls, 1u);
  EXPECT_EQ(f.mismatches, 1u);
  EXPECT_EQ(f.at_silhouette, 0u);
}

TEST(Fidelity, ADepthStepInTheNeighbourhoodIsNoFault) {
  std::vector<Hit> exact = square(), level = square();
  for (std::uint32_t y = 8; y < 24; ++y)
    for (std::uint32_t x = 16; x < 24; ++x) pixel(exact, x, y) = hit_at(7);
  // The level's step is one pixel off, either way.
  for (std::uint32_t y = 8; y < 24; ++y)
    for (std::uint32_t x = y < 16 ? 15 : 17; x < 24; ++x) pixel(level, x, y) = hit_at(7);
  EXPECT_EQ(compare(exact, level).leaks + compare(exact, level).walls, 0u);
  // Two pixels off is one.
  pixel(level, 14, 12) = hit_at(7);
  EXPECT_EQ(compare(exact, level).leaks, 1u);
}

TEST(Fidelity, TheSilhouetteIsNoInteriorFault) {
  std::vector<Hit> level = square();
  pixel(level, 8, 12) = kMiss;      // an edge pixel of the object
  pixel(level, 7, 12) = hit_at(5);  // just outside
  pixel(level, 2, 2) = hit_at(5);   // far outside
  const HitFidelity f = compare(square(), level);
  EXPECT_EQ(f.holes, 0u);
  EXPECT_EQ(f.mismatches, 3u);
  EXPECT_EQ(f.at_silhouette, 2u);
  EXPECT_DOUBLE_EQ(f.mismatch_percent(), 100.0 * 3 / 256);
  EXPECT_DOUBLE_EQ(f.silhouette_percent(), 100.0 * 2 / 3);
}

TEST(Fidelity, TheImageEdgeIsNotInterior) {
  const std::vector<Hit> exact(kSize * kSize, hit_at(5));
  std::vector<Hit> level = exact;
  pixel(level, 0, 5) = kMiss;
  const HitFidelity f = compare(exact, level);
  EXPECT_EQ(f.holes, 0u);
  EXPECT_EQ(f.mismatches, 1u);
}

TEST(Fidelity, DepthAndNormalErrorsAreThoseOfCommonHits) {
  std::vector<Hit> level = square();
  for (Hit& hit : level)
    if (hit.t == 5) hit.t = 5.001f;
  pixel(level, 20, 20) = {5.05f, {0, 1, 0}, 0, 0, 0, 0};
  pixel(level, 8, 8) = kMiss;
  const HitFidelity f = compare(square(), level);
  EXPECT_NEAR(f.dt.median, 1e-4, 1e-6);
  EXPECT_NEAR(f.dt.max, 5e-3, 1e-6);
  EXPECT_NEAR(f.normal_degrees.max, 90, 1e-4);
  EXPECT_NEAR(f.normal_degrees.p95, 0, 1e-4);
}

TEST(Fidelity, DistributionIsByNearestRank) {
  std::vector<float> values(1000);
  std::iota(values.rbegin(), values.rend(), 1.f);
  const Distribution d = distribution(values);
  EXPECT_EQ(d.median, 500);
  EXPECT_EQ(d.p95, 950);
  EXPECT_EQ(d.p99, 990);
  EXPECT_EQ(d.p999, 999);
  EXPECT_EQ(d.max, 1000);
  std::vector<float> one{3}, none;
  EXPECT_EQ(distribution(one).median, 3);
  EXPECT_TRUE(std::isnan(distribution(none).median));
}

TEST(Fidelity, ViewsArePooledAndTheWorstIsKept) {
  int cast = 0;
  const CastView exact = [](const CameraRays& rays) {
    return std::vector<Hit>(std::size_t{rays.width} * rays.height, hit_at(5));
  };
  const CastView level = [&cast](const CameraRays& rays) {
    std::vector<Hit> hits(std::size_t{rays.width} * rays.height, hit_at(5));
    const int holes = ++cast;
    for (int i = 0; i < holes; ++i) hits[rays.width * 3 + 3 + static_cast<std::size_t>(i)] = kMiss;
    return hits;
  };
  ViewsConfig config;
  config.views = 3;
  config.resolution = 16;
  const std::vector<ViewsFidelity> both =
      measure_views(exact, std::vector<CastView>{level, exact}, {{0, 0, 0}, {1, 1, 1}}, config);
  ASSERT_EQ(both.size(), 2u);
  EXPECT_EQ(both[1].all.mismatches, 0u);
  const ViewsFidelity& f = both[0];
  ASSERT_EQ(f.views.size(), 3u);
  EXPECT_EQ(f.views[1].holes, 2u);
  EXPECT_EQ(f.worst_holes, 3u);
  EXPECT_EQ(f.all.holes, 6u);
  EXPECT_EQ(f.all.pixels, 3u * 256);
}

}  // namespace
}  // namespace rbvh
