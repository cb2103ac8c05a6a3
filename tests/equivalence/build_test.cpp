// What a build guarantees, whatever the scan.
#include "pipeline/rbvh/build.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "pipeline/base/error.h"
#include "pipeline/device/device.h"
#include "pipeline/trace/trace_tile.h"
#include "tests/build_levels.h"
#include "tests/exact_scenes.h"
#include "tests/shapes.h"
#include "tests/trace_test.h"

namespace rbvh {
namespace {

bool same(const Level& a, const Level& b) {
  const auto bytes = [](const auto& x, const auto& y) {
    return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(x[0])) == 0;
  };
  if (!bytes(a.nodes, b.nodes) || !bytes(a.leaves, b.leaves) ||
      !bytes(a.primitive_leaves, b.primitive_leaves) || a.primitives.positions != b.primitives.positions ||
      a.primitives.triangles != b.primitives.triangles || a.layers.size() != b.layers.size())
    return false;
  for (std::size_t i = 0; i < a.layers.size(); ++i)
    if (!bytes(a.layers[i].texels, b.layers[i].texels)) return false;
  return true;
}

TEST(Build, GivesTheSameBytesAgainAndEachLevelAlone) {
  for (const Scan& scan : {bumpy_sphere(90), thicket(300, 1), noisy_discs(30, 1)}) {
    // Without exact leaves, faulty tiles are split longest.
    const Hybrid hybrid = scan.is_cloud() ? Hybrid::kOff : Hybrid::kAuto;
    const auto built = [&](std::vector<LevelConfig> levels) {
      return build(scan, std::move(levels), Refinement::kProjectedArea, hybrid);
    };
    const Rbvh first = built(standard_levels()), second = built(standard_levels());
    for (std::size_t i = 0; i < first.levels.size(); ++i) {
      EXPECT_TRUE(same(first.levels[i], second.levels[i])) << i;
      // Simplification goes on from the finer levels.
      const auto finer = standard_levels().begin();
      EXPECT_TRUE(
          same(first.levels[i], built({finer, finer + static_cast<std::ptrdiff_t>(i) + 1}).levels.back()))
          << i;
    }
  }
}

TEST(Build, LevelsShrinkAndTheConeIsNarrower) {
  const Scan scan = bumpy_sphere(200, 0.1f);
  const Rbvh rbvh = build(scan, by_density(standard_levels()));
  for (std::size_t i = 1; i < rbvh.levels.size(); ++i) {
    EXPECT_LT(rbvh.levels[i].texels_used, rbvh.levels[i - 1].texels_used);
    EXPECT_LE(rbvh.levels[i].leaves.size(), rbvh.levels[i - 1].leaves.size());
  }
  const Rbvh cone = build(scan, by_density({standard_levels()[4]}), Refinement::kConeOfNormals);
  EXPECT_NE(cone.levels[0].leaves.size(), rbvh.levels[4].leaves.size());
}

TEST(Build, WhereTilesMissTheErrorTrianglesKeepIt) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(seed);
  // Texels are as wide as three triangles.
  const LevelConfig level{"Q", 65e3f, 0.85f, 45, 1.6e-5f};
  for (const float roughness : {0.0f, 2e-5f, 1e-4f}) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> height(-roughness, roughness);
    Scan scan;
    add_sheet(scan, 2400, 120, [&](float s, float t) {
      return Vec3f{s, 0.05f * t, 0.01f * std::sin(9 * s) + height(random)};
    });
    const auto built = [&](Hybrid hybrid) {
      return build(scan, {level}, Refinement::kProjectedArea, hybrid).levels[0];
    };
    const Level own = built(Hybrid::kAuto);
    EXPECT_GT(own.reached, 0) << roughness;
    EXPECT_LE(own.reached, level.error) << roughness;
    const bool is_of_tiles = own.primitive_leaves.size() < own.leaves.size();
    EXPECT_EQ(is_of_tiles, roughness < 1e-4f) << roughness;
    if (!is_of_tiles) {
      EXPECT_GT(built(Hybrid::kOff).reached, level.error) << "where only tiles are wanted, they stay";
    }
  }
}

TEST(Build, NeedlesAndCrumbsAreEnough) {
  Scan needle, beside, crumb;
  needle.positions = {{0, 0, 0}, {1, 0, 0}, {0.5f, 1e-5f, 0}};
  needle.triangles = {{0, 1, 2}};
  add_plate(beside, 8, 0);
  crumb = beside;
  const auto add = [](Scan& scan, Vec3f from, float size, float width) {
    const auto first = static_cast<std::uint32_t>(scan.positions.size());
    for (const Vec3f p : {Vec3f{0, 0, 0}, Vec3f{size, 0, 0}, Vec3f{0.5f * size, width, 0}})
      scan.positions.push_back(from + p);
    scan.triangles.push_back({first, first + 1, first + 2});
  };
  add(beside, {5, 0, 0}, 1, 1e-5f);
  add(crumb, {5, 0, 0}, 2e-6f, 2e-6f);
  for (const Scan& scan : {needle, beside, crumb})
    EXPECT_EQ(build(scan, standard_levels()).levels.size(), standard_levels().size());
}

TEST(Build, OneTriangleIsEnoughAndNoAreaIsRefused) {
  Scan one;
  one.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  one.triangles = {{0, 1, 2}};
  const Level level = build(one, {standard_levels()[4]}).levels[0];
  EXPECT_TRUE(
      is_hit(cast(make_tile_tracer(Device::open(), level), {make_ray({0.2f, 0.2f, 1}, {0, 0, -1})})[0]));
  Scan line = one;
  line.positions[2] = {2, 0, 0};
  EXPECT_THROW(build(line, {standard_levels()[4]}), Error);
}

TEST(Build, CarriesNormalsAndColours) {
  Scan scan;
  add_plate(scan, 10, 0);
  scan.colors.assign(scan.positions.size(), {255, 0, 0});
  const Level level = build(scan, {{"Q", 1e3f, 0.85f, 45}}).levels[0];
  ASSERT_EQ(level.layers.size(), 3u);
  for (std::size_t i = 0; i < level.layers[0].texels.size(); ++i) {
    if (level.layers[0].texels[i] == 0) continue;
    EXPECT_EQ(level.layers[1].texels[i], 0x8080u);  // octahedral (0, 0): up
    EXPECT_EQ(level.layers[2].texels[i], 0xf800u);
  }
}

}  // namespace
}  // namespace rbvh
