// A level as triangles or points.
#include "pipeline/rbvh/level_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "pipeline/base/error.h"
#include "pipeline/measure/surface_distance.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/level_surface.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/rbvh/trim_tiles.h"
#include "rbvh/asset.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

/// Closed: of triangles of equal size, all edges with two of them.
Scan closed_sphere(int times) {
  Scan scan;
  scan.positions = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  scan.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int i = 0; i < times; ++i) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto [at, is_new] = middles.try_emplace(std::minmax(a, b), scan.positions.size());
      if (is_new) scan.positions.push_back(normalized(scan.positions[a] + scan.positions[b]));
      return at->second;
    };
    std::vector<Triangle> finer;
    for (const auto& [a, b, c] : scan.triangles) {
      const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    scan.triangles = std::move(finer);
  }
  return scan;
}

Level build_level(const Scan& scan, LevelConfig config, Hybrid hybrid = Hybrid::kAuto) {
  BuildConfig build;
  build.levels = {config};
  build.hybrid = hybrid;
  return std::move(build_rbvh(Device::open(), scan, build).levels[0]);
}

/// Of tiles: a quarter of the texels that the triangles have.
LevelConfig coarse_tiles() { return {"Q2", 3e4f, 0.75f, 55, 0}; }

void expect_no_duplicates(const Scan& mesh) {
  std::set<Triangle> seen;
  for (Triangle t : mesh.triangles) {
    std::sort(t.begin(), t.end());
    EXPECT_TRUE(seen.insert(t).second);
    EXPECT_TRUE(t[0] != t[1] && t[1] != t[2]);
  }
}

TEST(LevelMesh, TilesOfAClosedSphereAreClosed) {
  Scan scan = closed_sphere(7);  // 131,072 triangles
  for (const Vec3f& p : scan.positions)
    scan.colors.push_back({static_cast<std::uint8_t>(p.z > 0 ? 255 : 0), 0, 0});
  const Level level = build_level(scan, coarse_tiles());
  LevelMeshCounts counts;
  const Scan mesh = level_mesh(level, false, &counts);
  EXPECT_GT(counts.tile_quads, 10000u);
  EXPECT_GT(counts.trimmed_quads, 500u);
  EXPECT_GT(counts.stitch_triangles, 500u);
  EXPECT_EQ(counts.open_edges, 0u);
  EXPECT_EQ(counts.non_manifold_edges, 0u);
  // Euler: a sphere.
  EXPECT_EQ(mesh.positions.size() + mesh.triangles.size() - mesh.triangles.size() * 3 / 2, 2u);
  expect_no_duplicates(mesh);
  ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
  ASSERT_EQ(mesh.colors.size(), mesh.positions.size());
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3f p = mesh.positions[i];
    EXPECT_NEAR(length(p), 1, 1e-3f);
    EXPECT_GT(dot(mesh.normals[i], normalized(p)), 0.98f);
    if (std::abs(p.z) > 0.05f) {
      EXPECT_EQ(mesh.colors[i][0], p.z > 0 ? 255 : 0);
    }
  }
  for (const Triangle& t : mesh.triangles) {
    const Vec3f a = mesh.positions[t[0]];
    EXPECT_GE(dot(cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a), a), -1e-5f);
  }
  EXPECT_LT(sampled_distance(surface_of(scan), ClosestPoint(surface_of(mesh)), 20000).max, 2e-3);
}

TEST(LevelMesh, ALevelOfPrimitivesIsTheseAsTheyAre) {
  const Scan scan = closed_sphere(4);
  const Level level = build_level(scan, {"Q0", 2e6f, 0.85f, 45, 0}, Hybrid::kAlways);
  ASSERT_EQ(level.primitive_leaves.size(), level.leaves.size());
  LevelMeshCounts counts;
  const Scan mesh = level_mesh(level, false, &counts);
  EXPECT_EQ(mesh.positions, level.primitives.positions);
  EXPECT_EQ(mesh.triangles, level.primitives.triangles);
  EXPECT_EQ(counts.open_edges, 0u);
  EXPECT_EQ(counts.tile_quads, 0u);
}

/// A torus with a finely divided part, whose edges are shorter than coarse levels' lattices; its first ring
/// and its last have vertices of their own, almost at one place.
Scan closed_torus() {
  Scan scan;
  add_sheet(scan, 150, [](float s, float t) {
    const float along = 6.2831853f * s * s * s, around = 6.2831853f * t;
    const float r = 1 + 0.3f * std::cos(around) + 0.02f * std::sin(9 * along);
    return Vec3f{r * std::cos(along), r * std::sin(along), 0.3f * std::sin(around)};
  });
  return scan;
}

TEST(LevelMesh, LevelsOfPrimitivesAreClosedWhereTheScanIs) {
  for (const Scan& scan : {closed_sphere(6), closed_torus(), bumpy_sphere(120)}) {
    BuildConfig build;
    build.levels = standard_levels();
    build.hybrid = Hybrid::kAlways;
    for (const Level& level : build_rbvh(Device::open(), scan, build).levels) {
      LevelMeshCounts counts;
      const Scan mesh = level_mesh(level, false, &counts);
      ASSERT_EQ(level.primitive_leaves.size(), level.leaves.size());
      EXPECT_EQ(counts.open_edges, 0u) << level.name << " of " << scan.triangles.size();
      EXPECT_LE(counts.non_manifold_edges, 2u) << level.name << " of " << scan.triangles.size();
      expect_no_duplicates(mesh);
    }
  }
}

/// A ground with a fin on it, whose two sides are so far apart at their upper edge.
Scan ground_with_fin(float thickness) {
  constexpr std::uint32_t n = 20, rows = 8;
  Scan scan;
  const auto add = [&](float x, float y, float z) {
    scan.positions.push_back({x, y, z});
    return static_cast<std::uint32_t>(scan.positions.size() - 1);
  };
  const auto add_quad = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    scan.triangles.insert(scan.triangles.end(), {{a, b, c}, {a, c, d}});
  };
  for (std::uint32_t y = 0; y <= n; ++y)
    for (std::uint32_t x = 0; x <= n; ++x) add(static_cast<float>(x) / n, static_cast<float>(y) / n, 0);
  for (std::uint32_t y = 0; y < n; ++y)
    for (std::uint32_t x = 0; x < n; ++x)
      add_quad(y * (n + 1) + x, y * (n + 1) + x + 1, (y + 1) * (n + 1) + x + 1, (y + 1) * (n + 1) + x);
  std::vector<std::uint32_t> front(n + 1), back(n + 1);
  for (std::uint32_t x = 0; x <= n; ++x) front[x] = back[x] = n / 2 * (n + 1) + x;
  for (std::uint32_t row = 1; row <= rows; ++row) {
    const std::vector<std::uint32_t> front_below = front, back_below = back;
    for (std::uint32_t x = 0; x <= n; ++x) {
      const float z = 0.05f * static_cast<float>(row);
      front[x] = add(static_cast<float>(x) / n, 0.5f, z);
      back[x] = thickness > 0 ? add(static_cast<float>(x) / n, 0.5f + thickness, z) : front[x];
    }
    for (std::uint32_t x = 0; x < n; ++x) {
      add_quad(front_below[x], front_below[x + 1], front[x + 1], front[x]);
      add_quad(back_below[x + 1], back_below[x], back[x], back[x + 1]);
    }
  }
  if (thickness > 0)
    for (std::uint32_t x = 0; x < n; ++x) add_quad(front[x], front[x + 1], back[x + 1], back[x]);
  return scan;
}

TEST(LevelMesh, WhatIsThinnerThanALevelsErrorStaysOrTheLevelSaysThatItDoesNot) {
  const Device device = Device::open();
  for (const float thickness : {0.0f, 1e-5f, 1e-4f}) {
    const Scan scan = ground_with_fin(thickness);
    for (const bool by_density : {false, true}) {
      BuildConfig build;
      build.levels = standard_levels();
      if (by_density)
        for (LevelConfig& level : build.levels) level.error = 0;
      build.hybrid = Hybrid::kAlways;
      for (const Level& level : build_rbvh(device, scan, build).levels) {
        const DistanceStatistics from_scan =
            sampled_distance(surface_of(scan), ClosestPoint(surface_of(level_mesh(level, false))), 5000);
        EXPECT_TRUE(from_scan.max < 2e-3 || (level.error > 0 && level.reached > level.error))
            << level.name << " of a fin of " << thickness << ": " << from_scan.max;
      }
    }
  }
}

TEST(LevelMesh, TrimmedTilesDoNotOverlap) {
  Scan scan;
  add_plate(scan, 300, 0.1f);
  const Level level = build_level(scan, coarse_tiles());
  const std::vector<std::uint8_t> kept = trim_tiles(level).quads;
  double area = 0;
  for_each_quad(level, [&](std::uint32_t leaf, std::uint32_t, std::uint32_t, std::size_t texel) {
    const TileFrame frame(level.leaves[leaf]);
    area += kept[texel] != 0 ? length(frame.u) * length(frame.v) : 0;
  });
  EXPECT_LT(area, 1);
  EXPECT_GT(area, 0.8);
  double whole = 0;
  const Scan mesh = level_mesh(level, false);
  for (const Triangle& t : mesh.triangles) {
    const Vec3f a = mesh.positions[t[0]];
    whole += 0.5 * static_cast<double>(cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a).z);
  }
  EXPECT_NEAR(whole, 1, 0.02);
}

TEST(LevelMesh, OfAnAssetByName) {
  const Scan scan = closed_sphere(4);
  BuildConfig build;
  build.levels = standard_levels({"Q3", "Q4"});
  const Asset pair = build_pair(Device::open(), scan, build);
  EXPECT_LE(level_mesh(pair, "Q4").triangles.size(), level_mesh(pair).triangles.size());
  EXPECT_THROW(level_mesh(pair, "Q0"), Error);
  EXPECT_THROW(level_mesh(make_asset(Scan(scan))), Error);
}

}  // namespace
}  // namespace rbvh
