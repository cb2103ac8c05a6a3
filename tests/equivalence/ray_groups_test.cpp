// What a ray hits does not depend on the rays it is cast with: rays that begin close together, which traverse
// together, hit what each hits among strangers and alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "pipeline/device/device.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/trace/camera_rays.h"
#include "pipeline/trace/trace_exact.h"
#include "pipeline/trace/trace_tile.h"
#include "rbvh/camera.h"
#include "tests/shapes.h"
#include "tests/trace_test.h"

namespace rbvh {
namespace {

class RayGroups : public TraceTest {
 protected:
  static constexpr std::size_t kGroup = 16;

  /// In bundles of 16 from around a point on or near the surface, some with an interval that ends early.
  std::vector<Ray> bundles(const Scan& scan, std::size_t count) {
    const float size = bounds(scan).diagonal();
    std::vector<Ray> rays;
    while (rays.size() < count * kGroup) {
      const Vec3f at = scan.positions[random() % scan.positions.size()];
      for (std::size_t i = 0; i < kGroup; ++i) {
        const Vec3f from = at + uniform_direction(random) * size * uniform(random, 0, 0.01f);
        rays.push_back(make_ray(from, uniform_direction(random), 1e-4f * size,
                                i % 5 == 0 ? uniform(random, 0, size) : kInfinity));
      }
    }
    return rays;
  }

  void expect_same_hits(const Tracer& tracer, const std::vector<Ray>& rays, RayQuery query) {
    const std::vector<Hit> together = cast(tracer, rays, query);
    std::vector<std::size_t> order(rays.size());
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), random);
    std::vector<Ray> mixed(rays.size());
    for (std::size_t k = 0; k < order.size(); ++k) mixed[k] = rays[order[k]];
    const std::vector<Hit> among_strangers = cast(tracer, mixed, query);
    std::size_t hits = 0;
    for (std::size_t k = 0; k < order.size(); ++k) {
      const Hit &a = together[order[k]], &b = among_strangers[k];
      hits += is_hit(a);
      expect_same(a, b, query);
    }
    EXPECT_GT(hits, rays.size() / 10);
    for (std::size_t i = 0; i < rays.size(); i += 37) {
      SCOPED_TRACE(i);
      expect_same(together[i], cast(tracer, {rays[i]}, query)[0], query);
    }
  }

  static void expect_same(const Hit& a, const Hit& b, RayQuery query) {
    EXPECT_EQ(is_hit(a), is_hit(b));
    if (query == RayQuery::kAny) return;  // which one is found first may differ
    EXPECT_EQ(a.t, b.t);
    EXPECT_EQ(normal_of(a), normal_of(b));
    EXPECT_EQ(std::pair(a.u, a.v), std::pair(b.u, b.v));
    EXPECT_EQ(a.leaf, b.leaf);
    EXPECT_EQ(a.flags, b.flags);
  }

  void expect_same_hits(const Tracer& tracer, const std::vector<Ray>& rays) {
    expect_same_hits(tracer, rays, RayQuery::kNearest);
    expect_same_hits(tracer, rays, RayQuery::kAny);
  }

  static Level level_of(const Scan& scan, Hybrid hybrid, float error) {
    BuildConfig config;
    config.levels = {{"Q", 1e4f, 0.85f, 45, error}};
    config.hybrid = hybrid;
    return build_rbvh(Device::open(), scan, config).levels[0];
  }
};

TEST_F(RayGroups, OfTrianglesHitWhatEachHitsAlone) {
  const Scan scan = bumpy_sphere(60);
  expect_same_hits(make_exact_tracer(Device::open(), scan), bundles(scan, 100));
}

TEST_F(RayGroups, OfTrianglesWithoutSharedVerticesHitWhatEachHitsAlone) {
  const Scan scan = soup(random, 3000, 0.1f);
  expect_same_hits(make_exact_tracer(Device::open(), scan), bundles(scan, 100));
}

TEST_F(RayGroups, OfDiscsHitWhatEachHitsAlone) {
  const Scan scan = discs(random, 3000, 0.1f);
  expect_same_hits(make_exact_tracer(Device::open(), scan), bundles(scan, 100));
}

TEST_F(RayGroups, OfALevelOfPrimitivesHitWhatEachHitsAlone) {
  const Scan scan = bumpy_sphere(60);
  const Level level = level_of(scan, Hybrid::kAlways, 1e-4f);
  expect_same_hits(make_tile_tracer(Device::open(), level), bundles(scan, 100));
}

TEST_F(RayGroups, OfALevelOfTilesHitWhatEachHitsAlone) {
  const Scan scan = bumpy_sphere(60);
  const Level level = level_of(scan, Hybrid::kOff, 0);
  expect_same_hits(make_tile_tracer(Device::open(), level), bundles(scan, 100));
}

TEST_F(RayGroups, OfACameraHitWhatBeamsAndSingleRaysHit) {
  const Scan scan = bumpy_sphere(60);
  const Bounds3f box = bounds(scan);
  const CameraRays camera =
      camera_rays(views_around({Vec3d(box.lo), Vec3d(box.hi)}, {0, 0, 1}, 1, 1.0)[0], 45, 39);
  ExactTracer tracer = make_exact_tracer(Device::open(), scan);
  std::vector<std::vector<Hit>> pictures;
  for (const std::size_t beam_pixels : {std::size_t{0}, std::size_t{1}, std::size_t{1} << 30}) {
    tracer.beam_pixels = beam_pixels;
    const Buffer<Hit> hits(tracer.device, std::size_t{camera.width} * camera.height);
    tracer.intersect(camera, hits);
    pictures.push_back(hits.read());
  }
  for (std::size_t i = 0; i < pictures[0].size(); ++i)
    for (const std::vector<Hit>& picture : pictures) {
      SCOPED_TRACE(i);
      const Hit &a = pictures[0][i], &b = picture[i];
      EXPECT_EQ(a.t, b.t);
      EXPECT_EQ(a.leaf, b.leaf);
      EXPECT_EQ(a.flags, b.flags);
    }
}

}  // namespace
}  // namespace rbvh
