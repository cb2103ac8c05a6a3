// Points to texels and back: the point query finds all tiles that cover a point, painted values are read
// back, and there is no seam where tiles end.
#include "pipeline/rbvh/layers.h"

#include <gtest/gtest.h>

#include "pipeline/base/error.h"
#include "pipeline/measure/surface_distance.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/layer_codec.h"
#include "pipeline/rbvh/layer_painting.h"
#include "pipeline/rbvh/layer_sampling.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/scan/complete_cloud.h"
#include "tests/property.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

constexpr float kMost = 0.03f;  // from the surface

Level build_level(const Scan& scan, const std::string& name) {
  BuildConfig config;
  config.levels = {};
  for (const LevelConfig& level : standard_levels())
    if (level.name == name) config.levels = {level};
  return std::move(build_rbvh(Device::open(), scan, config).levels[0]);
}

/// Points spread over the triangles, by the property test's seed.
std::vector<Vec3f> points_on(const Scan& scan, std::size_t count) {
  std::mt19937_64 random(property_seed());
  std::uniform_int_distribution<std::size_t> any(0, scan.triangles.size() - 1);
  std::uniform_real_distribution<float> share(0, 1);
  std::vector<Vec3f> points(count);
  for (Vec3f& p : points) {
    const Triangle& t = scan.triangles[any(random)];
    float u = share(random), v = share(random);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Vec3f a = scan.positions[t[0]];
    p = a + (scan.positions[t[1]] - a) * u + (scan.positions[t[2]] - a) * v;
  }
  return points;
}

/// A ball and, so that leaves fall back to exact triangles, two crossing sheets.
Scan ball_and_crossing_sheets() {
  Scan scan = bumpy_sphere(60);
  add_sheet(scan, 3, [](float s, float t) { return Vec3f{2 + s, t, 0.3f * s}; });
  add_sheet(scan, 3, [](float s, float t) { return Vec3f{2 + s, t, 0.3f - 0.3f * s}; });
  return scan;
}

TEST(PointQuery, FindsEveryPointOfTheSurface) {
  const Scan scan = ball_and_crossing_sheets();
  const std::vector<Vec3f> points = points_on(scan, 4000);
  std::size_t primitive_leaves = 0;
  for (const char* name : {"Q0", "Q2", "Q4"}) {
    const Level level = build_level(scan, name);
    primitive_leaves += level.primitive_leaves.size();
    const PointHits hits = query_points(make_point_index(Device::open(), level), points);
    ASSERT_EQ(hits.points(), points.size());
    for (std::size_t i = 0; i < points.size(); ++i)
      EXPECT_FALSE(covering(level, hits.of(i), kMost).empty())
          << name << " point " << i << " " << points[i].x << " " << points[i].y << " " << points[i].z;
  }
  EXPECT_GT(primitive_leaves, 0u);
}

TEST(PointQuery, FindsTheLeavesThatBruteForceFinds) {
  const Scan scan = ball_and_crossing_sheets();
  const Level level = build_level(scan, "Q3");
  const std::vector<Vec3f> points = points_on(scan, 500);
  const std::vector<std::uint16_t>& heights = level.layers[0].texels;
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  for (const float radius : {0.0f, 0.2f}) {
    const PointHits hits = query_points(make_point_index(Device::open(), level), points, radius);
    for (std::size_t i = 0; i < points.size(); ++i) {
      std::vector<std::uint32_t> found, expected;
      for (const PointHit& hit : hits.of(i)) found.push_back(hit.leaf);
      for (const RbvhNode& node : level.nodes) {
        if (node.count == 0) continue;
        const RbvhLeaf& leaf = level.leaves[node.first];
        const TileFrame frame(leaf);
        const double border = 3 * std::max(length(frame.u), length(frame.v));
        double away2 = 0;
        for (int axis = 0; axis < 3; ++axis) {
          const double p = points[i][axis];
          away2 += std::pow(std::max({0.0, node.lo[axis] - border - p, p - node.hi[axis] - border}), 2);
        }
        const Vec3f at = to_tile(leaf, points[i]);
        // Rounding may decide: these are not compared.
        const auto is_near = [](float value, float limit) { return std::abs(value - limit) < 1e-3f; };
        if ((away2 > 0 && std::abs(std::sqrt(away2) - radius) < 1e-5) || is_near(at.x, std::round(at.x)) ||
            is_near(at.y, std::round(at.y))) {
          std::erase(found, node.first);
          continue;
        }
        if (away2 > radius * radius) continue;
        const bool is_exact = firsts[node.first] != RBVH_NO_LEAF;
        bool covers = at.x >= 0 && at.y >= 0 && at.x <= leaf.width - 1 && at.y <= leaf.height - 1;
        if (covers && !is_exact) {
          const std::size_t x = std::min<std::size_t>(static_cast<std::size_t>(at.x), leaf.width - 2u),
                            y = std::min<std::size_t>(static_cast<std::size_t>(at.y), leaf.height - 2u);
          const std::size_t texel = (leaf.y + y) * level.atlas_width + leaf.x + x;
          covers = heights[texel] != 0 || heights[texel + 1] != 0 ||
                   heights[texel + level.atlas_width] != 0 || heights[texel + level.atlas_width + 1] != 0;
        }
        if (covers || is_exact || radius > 0) expected.push_back(node.first);
      }
      std::sort(found.begin(), found.end());
      std::sort(expected.begin(), expected.end());
      EXPECT_EQ(found, expected) << "point " << i << " radius " << radius;
    }
  }
}

TEST(PointQuery, FindsNothingAwayFromTheSurface) {
  const Level level = build_level(bumpy_sphere(40), "Q2");
  const float nan = std::nanf("");
  const std::vector<Vec3f> points = {{0, 0, 0}, {5, 0, 0}, {nan, 0, 0}, {0, 0, 1.02f}};
  const PointHits hits = query_points(make_point_index(Device::open(), level), points, 0);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_TRUE(covering(level, hits.of(i), kMost).empty()) << i;
}

TEST(Layers, ReadWhatWasPainted) {
  const Scan scan = ball_and_crossing_sheets();
  Level level = build_level(scan, "Q1");
  const PointIndex index = make_point_index(Device::open(), level);
  const std::vector<Vec3f> points = points_on(scan, 12);
  for (const double scale : {1.0, 2.5, 0.5})
    for (const float radius : {0.0f, 0.05f}) {
      Layer layer = make_layer(level, "wear", 2, scale);
      std::vector<float> values;
      for (std::size_t i = 0; i < points.size(); ++i)
        values.insert(values.end(), {static_cast<float>(i) - 3.5f, 100.0f * static_cast<float>(i)});
      // One after the other, each read before the next could paint over it.
      for (std::size_t i = 0; i < points.size(); ++i) {
        const std::span<const Vec3f> p(&points[i], 1);
        const PaintCounts counts =
            paint_layer(index, level, layer, p, std::span(values).subspan(2 * i, 2), radius, kMost);
        EXPECT_EQ(counts.points_missed, 0u);
        EXPECT_GE(counts.texels, 4u);
        const std::vector<float> read = sample_layer(index, level, layer, p, kMost);
        const float step = (layer.hi - layer.lo) / 65534;
        EXPECT_NEAR(read[0], values[2 * i], step) << scale << " " << radius;
        EXPECT_NEAR(read[1], values[2 * i + 1], step) << scale << " " << radius;
      }
      // Where nothing was painted there is nothing.
      const std::vector<float> far = sample_layer(index, level, layer, std::vector<Vec3f>{{9, 9, 9}}, kMost);
      EXPECT_TRUE(std::isnan(far[0]));
    }
}

TEST(Layers, PaintReachesAsFarAsItsRadiusAndOverTileBorders) {
  Scan scan;
  add_sheet(scan, 40, [](float s, float t) {
    return Vec3f{s, t, 0.05f * std::sin(9 * s) * std::cos(7 * t)};
  });
  Level level = build_level(scan, "Q2");
  ASSERT_GT(level.leaves.size(), 20u);
  const PointIndex index = make_point_index(Device::open(), level);
  Layer layer = make_layer(level, "spot", 1, 1);
  const Vec3f center{0.5f, 0.5f, 0.05f * std::sin(4.5f) * std::cos(3.5f)};
  const float radius = 0.2f;
  paint_layer(index, level, layer, std::vector<Vec3f>{center}, std::vector<float>{7}, radius, kMost);
  std::size_t inside = 0, outside = 0;
  const std::vector<Vec3f> points = points_on(scan, 3000);
  const std::vector<float> read = sample_layer(index, level, layer, points, kMost);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float away = length(points[i] - center);
    if (away < radius - 0.005f) {
      ++inside;
      EXPECT_NEAR(read[i], 7, 1e-4) << away;
    } else if (away > radius + 0.01f) {
      ++outside;
      EXPECT_TRUE(std::isnan(read[i])) << away;
    }
  }
  EXPECT_GT(inside, 100u);
  EXPECT_GT(outside, 1000u);
  // A value that is not a number takes away what is there.
  paint_layer(index, level, layer, std::vector<Vec3f>{center}, std::vector<float>{std::nanf("")}, 2 * radius,
              kMost);
  EXPECT_TRUE(std::all_of(layer.texels.begin(), layer.texels.end(), [](auto code) { return code == 0; }));
}

TEST(Layers, OfSeveralPointsTheNearestPaints) {
  Scan scan;
  add_plate(scan, 8, 0);
  Level level = build_level(scan, "Q3");
  const PointIndex index = make_point_index(Device::open(), level);
  Layer layer = make_layer(level, "two", 1, 1);
  const std::vector<Vec3f> points = {{-0.2f, 0, 0}, {0.2f, 0, 0}};
  paint_layer(index, level, layer, points, std::vector<float>{1, 3}, 0.6f, kMost);
  const std::vector<float> read =
      sample_layer(index, level, layer, std::vector<Vec3f>{{-0.1f, 0.1f, 0}, {0.1f, -0.1f, 0}}, kMost);
  EXPECT_NEAR(read[0], 1, 1e-4);
  EXPECT_NEAR(read[1], 3, 1e-4);
}

TEST(Layers, OfAPropertyFollowItWithoutSeams) {
  Scan scan = bumpy_sphere(50);
  scan.properties.push_back({"x", {}});
  scan.properties.push_back({"some", {}});
  for (const Vec3f& p : scan.positions) {
    scan.properties[0].values.push_back(p.x);
    scan.properties[1].values.push_back(p.x > 0 ? 2.0f : std::nanf(""));
  }
  std::vector<Level> levels;
  levels.push_back(build_level(scan, "Q2"));
  const Level& level = levels[0];
  const PointIndex index = make_point_index(Device::open(), level);
  const std::vector<Vec3f> points = points_on(scan, 3000);
  std::vector<Vec3f> line;
  for (int i = 0; i < 20000; ++i) {
    const float phi = 0.3f + 1e-4f * static_cast<float>(i), z = 0.1f;
    const float theta = std::acos(z);
    const float r = 1 + 0.05f * std::sin(5 * phi) * std::sin(theta) * std::sin(4 * theta);
    line.push_back(Vec3f{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)} *
                   r);
  }
  for (const double scale : {1.0, 2.0, 0.4}) {
    add_property_layers(levels, scan, {"x", "some"}, scale);
    const Layer& layer = *find_layer(level, "x");
    EXPECT_EQ(layer.tiles.empty(), scale == 1.0 && level.primitive_leaves.empty());
    const std::vector<float> read = sample_layer(index, level, layer, points, kMost);
    for (std::size_t i = 0; i < points.size(); ++i)
      EXPECT_NEAR(read[i], points[i].x, 0.01 / std::min(scale, 1.0)) << scale;
    const std::vector<float> some = sample_layer(index, level, *find_layer(level, "some"), points, kMost);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (points[i].x > 0.15f) {
        EXPECT_NEAR(some[i], 2, 1e-4);
      }
      if (points[i].x < -0.15f) {
        EXPECT_TRUE(std::isnan(some[i]));
      }
    }
    // Along the line over many tiles, neighbours differ by no more than its own steps explain.
    const std::vector<float> along = sample_layer(index, level, layer, line, kMost);
    float most = 0;
    for (std::size_t i = 1; i < line.size(); ++i) {
      ASSERT_FALSE(std::isnan(along[i]));
      most = std::max(most, std::abs(along[i] - along[i - 1] - (line[i].x - line[i - 1].x)));
    }
    EXPECT_LT(most, 0.1 * texel_side(level) / scale) << scale;
  }
}

TEST(Layers, StandardOnesAreReadToo) {
  Scan scan = bumpy_sphere(60);
  for (const Vec3f& p : scan.positions)
    scan.colors.push_back({static_cast<std::uint8_t>(p.x > 0 ? 255 : 0), 0, 0});
  BuildConfig config;
  config.levels = by_density(standard_levels({"Q1"}));  // with all layers, for all leaves
  config.hybrid = Hybrid::kOff;
  const Level level = std::move(build_rbvh(Device::open(), scan, config).levels[0]);
  const PointIndex index = make_point_index(Device::open(), level);
  const std::vector<Vec3f> points = points_on(scan, 300);
  const std::vector<float> heights = sample_layer(index, level, *find_layer(level, "height"), points, kMost),
                           normals = sample_layer(index, level, *find_layer(level, "normal"), points, kMost),
                           colors = sample_layer(index, level, *find_layer(level, "color"), points, kMost);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_NEAR(heights[i], 0, 2e-3);
    const Vec3f n{normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]};
    EXPECT_NEAR(length(n), 1, 1e-5);
    EXPECT_GT(dot(n, normalized(points[i])), 0.7f);
    if (std::abs(points[i].x) > 0.15f) {  // not between vertices of both colours
      EXPECT_NEAR(colors[3 * i], points[i].x > 0 ? 1 : 0, 1e-3);
    }
  }
  Level painted = level;
  Layer& color = painted.layers.back();
  ASSERT_EQ(color.name, "color");
  paint_layer(index, painted, color, std::vector<Vec3f>{points[0]}, std::vector<float>{0, 1, 0}, 0.02f,
              kMost);
  const std::vector<float> green = sample_layer(index, painted, color, std::span(points).first(1), kMost);
  EXPECT_NEAR(green[0], 0, 1e-3);
  EXPECT_NEAR(green[1], 1, 1e-3);
}

TEST(Layers, OfCloudsAreReadAtItsPoints) {
  Scan scan;
  for (int j = 0; j < 50; ++j)
    for (int i = 0; i < 50; ++i)
      scan.positions.push_back({0.02f * static_cast<float>(i), 0.02f * static_cast<float>(j),
                                0.1f * std::sin(0.1f * static_cast<float>(i * j % 97))});
  complete_cloud(scan, {});
  scan.properties.push_back({"intensity", {}});
  for (const Vec3f& p : scan.positions) scan.properties[0].values.push_back(p.x < 0.5f ? -1.0f : 1.0f);
  for (const char* name : {"Q0", "Q4"}) {
    std::vector<Level> levels;
    levels.push_back(build_level(scan, name));
    add_property_layers(levels, scan, {"intensity"}, 1);
    const std::vector<float> read = sample_layer(make_point_index(Device::open(), levels[0]), levels[0],
                                                 *find_layer(levels[0], "intensity"), scan.positions, kMost);
    std::size_t found = 0, right = 0;
    for (std::size_t i = 0; i < read.size(); ++i) {
      found += !std::isnan(read[i]);
      right += std::abs(read[i] - scan.properties[0].values[i]) < 0.5f;
    }
    EXPECT_EQ(found, read.size()) << name;
    EXPECT_GT(right, read.size() * 17 / 20) << name;  // a texel of Q4 at the border of the values holds one
  }
}

TEST(Layers, RefuseUnknownProperties) {
  std::vector<Level> levels;
  Scan scan = bumpy_sphere(8);
  for (const char* name : {"nothing", "height"}) {
    try {
      add_property_layers(levels, scan, {name}, 1);
      ADD_FAILURE() << name;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kUsage);
    }
  }
}

TEST(Layers, KeepTheirValuesWhenTheirRangeGrows) {
  Level level;
  level.atlas_width = 8;
  level.atlas_height = 2;
  Layer layer;
  layer.texels.resize(16);
  set_values(layer, std::vector<std::size_t>{1, 2}, std::vector<float>{0.25f, 0.75f});
  EXPECT_EQ(layer.texels[0], 0);
  EXPECT_EQ(layer.texels[1], 1);
  EXPECT_EQ(layer.texels[2], 65535);
  set_values(layer, std::vector<std::size_t>{3}, std::vector<float>{-10});
  EXPECT_EQ(layer.lo, -10);
  EXPECT_EQ(layer.hi, 0.75f);
  EXPECT_NEAR(-10 + 10.75 * (layer.texels[1] - 1) / 65534, 0.25, 10.75 / 65534);
}

}  // namespace
}  // namespace rbvh
