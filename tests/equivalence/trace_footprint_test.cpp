// Rays that choose their level: each hits what its level alone would give, the level fits the ray's width,
// and no ray slips through where the level changes.
#include "pipeline/trace/trace_footprint.h"

#include <gtest/gtest.h>

#include "pipeline/device/device.h"
#include "pipeline/rbvh/build.h"
#include "rbvh/camera.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

TEST(Footprint, TheCoarsestLevelWhoseTexelsItCovers) {
  const std::vector<float> texels = {1, 2, 4, 8};
  EXPECT_EQ(level_for_width(texels, 0), 0u);
  EXPECT_EQ(level_for_width(texels, 1.9f), 0u);
  EXPECT_EQ(level_for_width(texels, 2), 1u);
  EXPECT_EQ(level_for_width(texels, 7), 2u);
  EXPECT_EQ(level_for_width(texels, 100), 3u);
}

// A long wavy sheet that is seen along its length: all levels in one picture.
struct Strip {
  Device device = Device::open();
  Rbvh rbvh;
  Strip() {
    Scan scan;
    add_sheet(scan, 120, [](float s, float t) {
      const float x = 40 * s, y = 4 * t - 2;
      return Vec3f{x, y, 0.1f * std::sin(2 * x) * std::cos(3 * y)};
    });
    rbvh = build_rbvh(device, scan, {});
  }
};

TEST(Footprint, EachRaySeesItsLevelAndNoneSlipsThrough) {
  const Strip strip;
  const FootprintTracer tracer = make_footprint_tracer(strip.device, strip.rbvh);
  const Camera camera = place_camera({.position = Vec3d{-1, 0, 1.5},
                                      .focal_point = Vec3d{8, 0, 0},
                                      .view_up = Vec3d{0, 0, 1},
                                      .view_angle = 30,
                                      .azimuth = {},
                                      .elevation = {}},
                                     {{0, -2, -1}, {40, 2, 1}}, {0, 0, 1}, 1);
  const CameraRays rays = camera_rays(camera, 320, 240);
  const std::size_t count = 320 * 240;
  const Buffer<Hit> hits(strip.device, count);
  const Buffer<std::uint32_t> steps(strip.device, count);
  tracer.intersect(rays, hits, &steps);
  const std::vector<Hit> found = hits.read();
  std::vector<std::vector<Hit>> alone;
  for (const TileTracer& level : tracer.levels) {
    level.intersect(rays, hits);
    alone.push_back(hits.read());
  }
  const float pixel = length(Vec3f{rays.right[0], rays.right[1], rays.right[2]});
  std::vector<std::size_t> seen(tracer.levels.size());
  std::size_t past_the_edge = 0, missed = 0, jumped = 0, hit = 0;
  for (std::size_t i = 0; i < count; ++i) {
    // The finest level decides what is visible at all.
    if (!std::isfinite(found[i].t)) {
      missed += std::isfinite(alone[0][i].t);
      continue;
    }
    const std::size_t level = level_of_leaf(tracer, found[i].leaf);
    ++seen[level];
    ++hit;
    const Hit& same = alone[level][i];
    EXPECT_NEAR(found[i].t, same.t, 2e-4f * same.t) << i;
    const float coarse = alone.back()[i].t;
    if (std::isfinite(coarse)) {
      EXPECT_EQ(level, level_for_width(tracer.texels, coarse * pixel));
    }
    if (std::isfinite(alone[0][i].t)) {
      jumped += std::abs(found[i].t - alone[0][i].t) > 0.05f * found[i].t;  // at a crest, seen from the side
    } else {
      ++past_the_edge;  // coarse texels extend further
    }
  }
  EXPECT_GT(hit, 5000u);
  for (const std::size_t few : {past_the_edge, missed, jumped}) EXPECT_LT(few, hit / 100);
  for (std::size_t level = 0; level < 4; ++level) EXPECT_GT(seen[level], 50u) << level;
  const std::vector<std::uint32_t> visited = steps.read();
  for (std::size_t i = 0; i < count; ++i)
    EXPECT_TRUE(visited[i] > 0 || !std::isfinite(found[i].t)) << i;  // rays beside everything visit nothing
}

TEST(Footprint, RaysWithoutAWidthSeeTheFinest) {
  const Strip strip;
  std::vector<Ray> rays;
  for (int i = 0; i < 500; ++i)
    rays.push_back({{0.08f * static_cast<float>(i), 0.3f, 5}, 0, {0.1f, 0, -2}, 100});
  const Buffer<Ray> buffer(strip.device, rays);
  const Buffer<Hit> hits(strip.device, rays.size());
  make_tile_tracer(strip.device, strip.rbvh.levels[0])
      .intersect(buffer, hits, rays.size(), RayQuery::kNearest);
  const std::vector<Hit> finest = hits.read();
  const float wide = 2.0f;
  for (const float spread : {0.0f, wide}) {
    const FootprintTracer tracer = make_footprint_tracer(strip.device, strip.rbvh, spread);
    tracer.intersect(buffer, hits, rays.size(), RayQuery::kNearest);
    const std::vector<Hit> found = hits.read();
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (!std::isfinite(found[i].t)) continue;
      EXPECT_EQ(level_of_leaf(tracer, found[i].leaf), spread == wide ? 4u : 0u);
      if (spread == 0) {
        EXPECT_EQ(found[i].t, finest[i].t);
      }
    }
  }
}

}  // namespace
}  // namespace rbvh
