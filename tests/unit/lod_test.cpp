// Levels made of levels, and sets of them that fit.
#include "pipeline/rbvh/lod.h"

#include <gtest/gtest.h>

#include <functional>

#include "pipeline/base/error.h"
#include "pipeline/measure/surface_distance.h"
#include "pipeline/rbvh/check_rbvh.h"
#include "pipeline/rbvh/level_mesh.h"
#include "pipeline/rbvh/level_surface.h"
#include "pipeline/scan/complete_cloud.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

std::vector<LevelConfig> configs(std::initializer_list<const char*> names) {
  std::vector<LevelConfig> chosen;
  for (const LevelConfig& level : standard_levels())
    if (std::find(names.begin(), names.end(), level.name) != names.end()) chosen.push_back(level);
  return chosen;
}

TEST(Lod, TakesTheFinestSetThatFits) {
  using Set = std::vector<std::size_t>;
  const std::vector<std::uint64_t> bytes = {700, 400, 200, 60, 20};
  EXPECT_EQ(choose_levels_by_bytes(bytes, 1380), (Set{0, 1, 2, 3, 4}));
  EXPECT_EQ(choose_levels_by_bytes(bytes, 1379), (Set{0, 1, 2, 3}));
  EXPECT_EQ(choose_levels_by_bytes(bytes, 800), (Set{0, 3, 4}));
  EXPECT_EQ(choose_levels_by_bytes(bytes, 699), (Set{1, 2, 3, 4}));
  EXPECT_EQ(choose_levels_by_bytes(bytes, 59), (Set{4}));
  EXPECT_EQ(choose_levels_by_bytes(bytes, 19), Set{});
  EXPECT_EQ(choose_levels_by_bytes({}, 19), Set{});
}

/// Levels without contents.
Rbvh with_levels(std::initializer_list<const char*> names) {
  Rbvh rbvh;
  for (const LevelConfig& config : configs(names)) {
    Level& level = rbvh.levels.emplace_back();
    level.name = config.name;
    level.rho = config.rho;
  }
  return rbvh;
}

ErrorKind kind_of_error(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    return error.kind();
  }
  ADD_FAILURE() << "no error";
  return {};
}

TEST(Lod, LevelsAreChosenByName) {
  using Names = std::vector<std::string>;
  Rbvh rbvh = with_levels({"Q1", "Q3"});
  EXPECT_EQ(choose_levels_by_name(rbvh, {}, {}, "a").names, (Names{"Q1", "Q3"}));
  EXPECT_EQ(choose_levels_by_name(rbvh, {}, {"Q1"}, "a").names, Names{"Q3"});
  const LevelChoice choice = choose_levels_by_name(rbvh, {"Q4", "Q3"}, {}, "a");
  EXPECT_EQ(choice.names, (Names{"Q3", "Q4"}));
  ASSERT_EQ(choice.derived.size(), 1u);
  EXPECT_EQ(choice.derived[0].name, "Q4");
  EXPECT_EQ(derivable_levels(rbvh, rbvh.levels[0]).size(), 2u);
  EXPECT_EQ(derivable_levels(rbvh, rbvh.levels[1]).size(), 1u);
  for (const auto& names : {std::pair<Names, Names>{{"Q0"}, {}},  // finer than what is there
                            {{"Q7"}, {}},
                            {{}, {"Q2"}},
                            {{}, {"Q1", "Q3"}}})
    EXPECT_EQ(kind_of_error([&] { choose_levels_by_name(rbvh, names.first, names.second, "a"); }),
              ErrorKind::kUsage);
  keep_levels(rbvh, {"Q3"});
  EXPECT_EQ(level_names(rbvh), "Q3");
}

void set_measured(Level& level, float rms) {
  level.fidelity.measured = true;
  level.fidelity.more.views = 1;
  level.fidelity.more.to_scan_rms = rms;
}

TEST(Lod, TheCoarsestLevelWithinAnErrorIsChosen) {
  Rbvh rbvh = with_levels({"Q0", "Q1", "Q2"});
  rbvh.source.triangles = 1;
  EXPECT_EQ(unmeasured_levels(rbvh).size(), 3u);
  EXPECT_EQ(kind_of_error([&] { choose_level_by_error(rbvh, 1, "a"); }), ErrorKind::kInput)
      << "by density, and not measured";
  float rms = 0.001f;
  for (Level& level : rbvh.levels) {
    set_measured(level, rms);
    rms *= 2;
  }
  EXPECT_TRUE(unmeasured_levels(rbvh).empty());
  EXPECT_EQ(choose_level_by_error(rbvh, 0.3, "a").name, "Q1");  // percent
  EXPECT_EQ(choose_level_by_error(rbvh, 9, "a").name, "Q2");
  EXPECT_EQ(kind_of_error([&] { choose_level_by_error(rbvh, 0.09, "a"); }), ErrorKind::kBudget);
}

TEST(Lod, WhatWasReachedCountsMoreThanWhatWasAskedFor) {
  Rbvh rbvh = with_levels({"Q0", "Q1", "Q2"});
  rbvh.source.triangles = 1;
  for (std::size_t i = 0; i < 3; ++i) rbvh.levels[i].error = standard_levels()[i].error;
  EXPECT_EQ(choose_level_by_error(rbvh, 0.0032, "a").name, "Q1") << "3.2e-5, which floats round";
  EXPECT_EQ(choose_level_by_error(rbvh, 0.0031, "a").name, "Q0");
  EXPECT_FALSE(known_error(rbvh, rbvh.levels[1]).is_measured);
  set_measured(rbvh.levels[1], 4e-5f);
  EXPECT_TRUE(known_error(rbvh, rbvh.levels[1]).is_measured);
  EXPECT_EQ(choose_level_by_error(rbvh, 0.0032, "a").name, "Q0");
  set_measured(rbvh.levels[2], 1e-5f);
  EXPECT_EQ(choose_level_by_error(rbvh, 0.0032, "a").name, "Q2");
  rbvh.source.triangles = 0;
  EXPECT_EQ(kind_of_error([&] { choose_level_by_error(rbvh, 1, "a"); }), ErrorKind::kInput)
      << "a cloud's Q0 was not measured";
}

/// A sheet whose heights alternate from vertex to vertex.
Scan rough_sheet(int n, float height) {
  Scan scan;
  int i = 0;
  add_sheet(scan, n, [&](float s, float t) {
    return Vec3f{s, t, static_cast<float>(i++ * 7919 % 13) * height / 12};
  });
  return scan;
}

TEST(Lod, ALevelThatMissesItsErrorIsNotTrusted) {
  const Device device = Device::open();
  const Scan scan = rough_sheet(150, 0.04f);  // its triangles are as small as texels
  BuildConfig config;
  config.levels = configs({"Q4"});
  config.hybrid = Hybrid::kOff;
  const Rbvh tiles = build_rbvh(device, scan, config);
  for (const Level& level : tiles.levels) {
    ASSERT_TRUE(level.primitive_leaves.empty());
    EXPECT_GT(level.reached, level.error) << level.name;
    EXPECT_GE(known_error(tiles, level).percent, 100 * static_cast<double>(level.reached)) << level.name;
    const double rms = sampled_distance(surface_of(scan), ClosestPoint(surface_of(level)), 20000).rms /
                       static_cast<double>(bounds(scan).diagonal());
    EXPECT_GT(static_cast<double>(level.reached), 0.7 * rms) << level.name;
  }
  EXPECT_EQ(kind_of_error(
                [&] { choose_level_by_error(tiles, 100 * static_cast<double>(tiles.levels[0].error), "a"); }),
            ErrorKind::kBudget);
  config.hybrid = Hybrid::kAlways;  // simplified triangles keep theirs
  for (const Level& level : build_rbvh(device, scan, config).levels) {
    EXPECT_GT(level.reached, 0) << level.name;
    EXPECT_LT(level.reached, level.error) << level.name;
  }
}

TEST(Lod, DerivedLevelsKeepObjectsWhereTheyCan) {
  const Device device = Device::open();
  Scan scan = bumpy_sphere(40);
  const auto first = static_cast<std::uint32_t>(scan.positions.size());
  const std::size_t count = scan.triangles.size();
  for (std::uint32_t i = 0; i < first; ++i) scan.positions.push_back(scan.positions[i] + Vec3f{3, 0, 0});
  for (std::size_t i = 0; i < count; ++i) {
    const Triangle t = scan.triangles[i];
    scan.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  for (std::size_t i = 0; i < 2 * count; ++i) scan.object_ids.push_back(i < count ? 4 : 7);
  for (const Hybrid hybrid : {Hybrid::kAlways, Hybrid::kOff}) {
    BuildConfig config;
    config.levels = configs({"Q3"});
    config.hybrid = hybrid;
    const Rbvh rbvh = build_rbvh(device, scan, config);
    const Level& from = rbvh.levels[0];
    EXPECT_EQ(objects_of(from), (std::vector<std::uint32_t>{4, 7}));
    ASSERT_EQ(keeps_objects(from, false), hybrid == Hybrid::kAlways);
    const Scan mesh = level_mesh(from, false);
    const std::vector<Level> derived = derive_levels(device, rbvh, from, configs({"Q4"}));
    // As far from the scan as the level that it is derived from, and its own error.
    EXPECT_GE(derived[0].reached, std::max(from.error, from.reached) + derived[0].error);
    if (!keeps_objects(from, false)) {
      EXPECT_TRUE(mesh.object_ids.empty());
      EXPECT_EQ(objects_of(derived[0]), std::vector<std::uint32_t>{0});
      continue;
    }
    ASSERT_EQ(mesh.object_ids.size(), mesh.triangles.size());
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
      EXPECT_EQ(mesh.object_ids[i], mesh.positions[mesh.triangles[i][0]].x < 1.5f ? 4 : 7);
    EXPECT_EQ(objects_of(derived[0]), (std::vector<std::uint32_t>{4, 7}));
  }
}

TEST(Lod, TheMeshOfALevelIsItsSurface) {
  Scan scan = bumpy_sphere(60);
  for (const Vec3f& p : scan.positions)
    scan.colors.push_back({static_cast<std::uint8_t>(p.z > 0 ? 255 : 0), 0, 0});
  BuildConfig config;
  config.levels = configs({"Q2"});
  const Level level = std::move(build_rbvh(Device::open(), scan, config).levels[0]);
  const Scan again = level_mesh(level, false);
  ASSERT_EQ(again.normals.size(), again.positions.size());
  ASSERT_EQ(again.colors.size(), again.positions.size());
  const ClosestPoint original(surface_of(scan));
  for (std::size_t i = 0; i < again.positions.size(); i += 7) {
    const Vec3f p = again.positions[i];
    EXPECT_LT(original.distance(p), 5e-3f);
    EXPECT_GT(dot(again.normals[i], normalized(p)), 0.6f);
    if (std::abs(p.z) > 0.1f) {
      EXPECT_EQ(again.colors[i][0], p.z > 0 ? 255 : 0);
    }
  }
}

TEST(Lod, DerivedLevelsAreNearlyAsCloseAsThoseOfTheScan) {
  const Device device = Device::open();
  Scan scan = bumpy_sphere(40);
  // Sheets that cross: leaves that fall back to exact triangles.
  add_sheet(scan, 3, [](float s, float t) { return Vec3f{2 + s, t, 0.3f * s}; });
  add_sheet(scan, 3, [](float s, float t) { return Vec3f{2 + s, t, 0.3f - 0.3f * s}; });
  BuildConfig config;
  config.levels = configs({"Q1", "Q3"});
  Rbvh rbvh = build_rbvh(device, scan, config);
  const ClosestPoint original(surface_of(scan));
  std::vector<Level> derived = derive_levels(device, rbvh, rbvh.levels[0], configs({"Q3", "Q4"}));
  ASSERT_EQ(derived.size(), 2u);
  EXPECT_EQ(derived[0].derived_from, "Q1");
  EXPECT_FALSE(derived[0].fidelity.measured);
  EXPECT_NEAR(texel_side(derived[0]), texel_side(rbvh.levels[1]), 0.25 * texel_side(rbvh.levels[1]));
  const auto rms = [&](const Level& level) {
    return std::max(sampled_distance(surface_of(level), original, 20000).rms,
                    sampled_distance(surface_of(scan), ClosestPoint(surface_of(level)), 20000).rms);
  };
  EXPECT_LT(rms(derived[0]), std::max(2 * rms(rbvh.levels[1]), 0.01 * texel_side(rbvh.levels[1])));
  Rbvh small;
  small.source = rbvh.source;
  small.levels = std::move(derived);
  EXPECT_EQ(find_fault(small).value_or(""), "");
  EXPECT_EQ(find_texel_fault(small).value_or(""), "");
}

TEST(Lod, CloudsAreDerivedAsDiscs) {
  const Device device = Device::open();
  Scan scan;
  for (int j = 0; j < 60; ++j)
    for (int i = 0; i < 60; ++i)
      scan.positions.push_back({0.02f * static_cast<float>(i), 0.02f * static_cast<float>(j),
                                0.2f * std::sin(0.1f * static_cast<float>(i))});
  complete_cloud(scan, {});
  BuildConfig config;
  config.levels = configs({"Q0", "Q3"});
  const Rbvh rbvh = build_rbvh(device, scan, config);
  for (const std::size_t from : {0u, 1u}) {
    const Scan discs = level_mesh(rbvh.levels[from], true);
    EXPECT_TRUE(discs.is_cloud());
    EXPECT_EQ(discs.radii.size(), discs.positions.size());
    const std::vector<Level> derived = derive_levels(device, rbvh, rbvh.levels[from], configs({"Q4"}));
    const ClosestPoint points(surface_of(scan)), level(surface_of(derived[0]));
    const double texel = texel_side(derived[0]);
    EXPECT_LT(sampled_distance(surface_of(scan), level, 5000).rms, texel) << from;
    EXPECT_LT(sampled_distance(surface_of(derived[0]), points, 5000).rms, texel) << from;
  }
}

}  // namespace
}  // namespace rbvh
