// Quality by distance: what a level requires, and that builds follow it.
#include "pipeline/rbvh/focus.h"

#include <gtest/gtest.h>

#include "pipeline/device/device.h"
#include "pipeline/measure/surface_distance.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/check_rbvh.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/trace/trace_tile.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

const LevelConfig& standard(const std::string& name) {
  for (const LevelConfig& level : standard_levels())
    if (level.name == name) return level;
  throw std::out_of_range(name);
}

TEST(Focus, QualityFallsFromTheFocusLevelToTheLevelsOwn) {
  const Focus focus{{0, 0, 0}, 2, standard("Q0")};
  const LevelConfig& own = standard("Q4");
  EXPECT_EQ(quality_at(own, nullptr, 0).rho, own.rho);
  EXPECT_EQ(quality_at(own, &focus, 0).rho, standard("Q0").rho);
  EXPECT_EQ(quality_at(own, &focus, 2).alpha, standard("Q0").alpha);
  // Texels twice as wide at twice the distance.
  EXPECT_EQ(quality_at(own, &focus, 4).rho, standard("Q0").rho / 4);
  EXPECT_EQ(quality_at(own, &focus, 1000).rho, own.rho);
  EXPECT_EQ(quality_at(own, &focus, 1000).alpha, own.alpha);
  float last = 1e9f;
  for (float d = 0; d < 30; d += 0.1f) {
    const LevelConfig here = quality_at(own, &focus, d);
    EXPECT_LE(here.rho, last);
    EXPECT_GE(here.rho, std::max(own.rho, standard("Q0").rho * std::min(1.0f, 4 / (d * d)) / 2));
    EXPECT_GE(here.phi_degrees, standard("Q0").phi_degrees);
    EXPECT_LE(here.phi_degrees, own.phi_degrees);
    last = here.rho;
  }
  EXPECT_EQ(quality_at(standard("Q0"), &focus, 1000).rho, standard("Q0").rho)
      << "never coarser than the level";
}

TEST(Focus, DistancesToABox) {
  const Bounds3f box{{0, 0, 0}, {1, 2, 3}};
  EXPECT_EQ(distances(box, {0.5f, 1, 1}).nearest, 0);
  EXPECT_FLOAT_EQ(distances(box, {0.5f, 1, 1}).farthest, std::sqrt(0.25f + 1 + 4));
  EXPECT_EQ(distances(box, {4, 2, 3}).nearest, 3);
  EXPECT_FLOAT_EQ(distances(box, {4, 2, 3}).farthest, std::sqrt(16.0f + 4 + 9));
}

TEST(Focus, HeightsAreRoundedToTheErrorThere) {
  const Scan scan = bumpy_sphere(100);
  BuildConfig config;
  config.levels = {standard("Q4")};
  config.hybrid = Hybrid::kOff;
  config.focus = Focus{{0, 0, 1}, 0.2f, standard("Q0")};
  const Level level = std::move(build_rbvh(Device::open(), scan, config).levels[0]);
  const auto error = static_cast<double>(standard("Q0").error * bounds(scan).diagonal());
  for (const RbvhLeaf& leaf : level.leaves) {
    const TileFrame frame(leaf);
    EXPECT_LE(length(frame.w), std::max(error, length(frame.u) / 250));
  }
}

TEST(Focus, BuildsFollowIt) {
  const Device device = Device::open();
  const Scan scan = bumpy_sphere(120);
  BuildConfig config;
  config.levels = by_density({standard("Q4")});
  const Rbvh plain = build_rbvh(device, scan, config);
  config.focus = Focus{{0, 0, 1}, 0.25f, standard("Q1")};
  const Rbvh focused = build_rbvh(device, scan, config);
  EXPECT_EQ(find_fault(focused).value_or(""), "");
  const Level& level = focused.levels[0];
  EXPECT_GT(level.texels_used, 2 * plain.levels[0].texels_used);
  // A texel's side within the radius, between, and far away, as multiples of those of the whole level.
  const double fine = 1 / std::sqrt(standard("Q1").rho / focused.source.area),
               coarse = 1 / std::sqrt(standard("Q4").rho / focused.source.area);
  int near = 0, far = 0;
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  for (std::size_t k = 0; k < level.leaves.size(); ++k) {
    if (firsts[k] != RBVH_NO_LEAF) continue;  // it has no texels
    const RbvhLeaf& leaf = level.leaves[k];
    const TileFrame frame(leaf);
    const Vec3f middle = frame.at(leaf.width / 2.0, leaf.height / 2.0, 1000);
    const double away = length(middle - Vec3f{0, 0, 1}), side = length(frame.u);
    if (away < 0.15) {
      ++near;
      EXPECT_LT(side, 1.5 * fine);
    }
    if (away > 1.9) {
      ++far;
      EXPECT_GT(side, 0.5 * coarse);
    }
  }
  EXPECT_GT(near, 3);
  EXPECT_GT(far, 3);
  // No crack where the quality changes: rays at the ball all hit.
  std::vector<Ray> rays;
  for (int i = 0; i < 20000; ++i) {
    const float z = 1 - 2 * (static_cast<float>(i) + 0.5f) / 20000, phi = 2.39996323f * static_cast<float>(i);
    const float r = std::sqrt(1 - z * z);
    const Vec3f d{r * std::cos(phi), r * std::sin(phi), z};
    rays.push_back({{3 * d.x, 3 * d.y, 3 * d.z}, 0, {-d.x, -d.y, -d.z}, 10});
  }
  const TileTracer tracer = make_tile_tracer(device, level);
  const Buffer<Hit> hits(device, rays.size());
  tracer.intersect(Buffer<Ray>(device, rays), hits, rays.size(), RayQuery::kNearest);
  int missed = 0;
  for (const Hit& hit : hits.read()) missed += !(hit.t < 2.5f);
  EXPECT_EQ(missed, 0);
  // The same work gives the same pair.
  const Rbvh again = build_rbvh(device, scan, config);
  EXPECT_EQ(again.levels[0].layers[0].texels, level.layers[0].texels);
}

}  // namespace
}  // namespace rbvh
