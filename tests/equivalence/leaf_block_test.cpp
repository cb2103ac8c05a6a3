// Levels that hold primitives against brute force over these: blocks of triangles on a lattice or anywhere,
// and of discs; single rays, beams and any hit.
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/device/device.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/trace/camera_rays.h"
#include "pipeline/trace/level_tree.h"
#include "pipeline/trace/trace_tile.h"
#include "rbvh/camera.h"
#include "tests/oracle.h"
#include "tests/shapes.h"
#include "tests/trace_test.h"

namespace rbvh {
namespace {

class LeafBlock : public TraceTest {};

Level level_of(const Scan& scan, float error) {
  BuildConfig config;
  config.levels = {{"Q", 1e4f, 0.85f, 45, error}};
  config.hybrid = Hybrid::kAlways;
  return build_rbvh(Device::open(), scan, config).levels[0];
}

oracle::Point point_at(const Vec3f& p) { return {p.x, p.y, p.z}; }

oracle::Meeting meeting_of(const Scan& primitives, std::uint32_t i, const Ray& ray) {
  const oracle::Point o{ray.origin[0], ray.origin[1], ray.origin[2]},
      d{ray.direction[0], ray.direction[1], ray.direction[2]};
  if (!primitives.radii.empty())
    return oracle::intersect_disc(point_at(primitives.positions[i]), point_at(primitives.normals[i]),
                                  static_cast<double>(primitives.radii[i]), o, d);
  const Triangle& t = primitives.triangles[i];
  return oracle::intersect_triangle(point_at(primitives.positions[t[0]]),
                                    point_at(primitives.positions[t[1]]),
                                    point_at(primitives.positions[t[2]]), o, d);
}

/// The nearest hit; `margin`: what is hit so close to its edge may be missed.
struct Nearest {
  double t = std::numeric_limits<double>::infinity(), margin = 0;
};

Nearest brute_force(const Level& level, const Ray& ray) {
  Nearest nearest;
  for (std::uint32_t i = 0; i < primitive_count(level); ++i) {
    const oracle::Meeting m = meeting_of(level.primitives, i, ray);
    if (!m.crosses || m.inside < 0 || m.t < static_cast<double>(ray.tmin)) continue;
    if (m.t < nearest.t) nearest = {m.t, m.inside};
  }
  return nearest;
}

void expect_hit(const Level& level, const Ray& ray, const Hit& hit) {
  constexpr double kClose = 1e-5;
  const Nearest nearest = brute_force(level, ray);
  if (!is_hit(hit)) {
    EXPECT_LT(nearest.margin, kClose);
    return;
  }
  // It is the primitive that the hit names, and none is nearer.
  const std::uint32_t first = first_primitives(level)[hit.leaf],
                      place = hit.flags >> RBVH_HIT_PRIMITIVE_SHIFT;
  ASSERT_NE(hit.flags & RBVH_HIT_ON_PRIMITIVE, 0u);
  ASSERT_LT(place, level.leaves[hit.leaf].primitives);
  const oracle::Meeting named = meeting_of(level.primitives, first + place, ray);
  ASSERT_TRUE(named.crosses);
  EXPECT_GT(named.inside, -kClose);
  EXPECT_NEAR(named.t, static_cast<double>(hit.t), 1e-5 * (1 + std::abs(named.t)));
  EXPECT_NEAR(std::abs(oracle::dot(named.normal, {hit.normal[0], hit.normal[1], hit.normal[2]})), 1, 1e-4);
  if (nearest.margin > kClose) {
    EXPECT_LT(static_cast<double>(hit.t), nearest.t + 1e-5 * (1 + nearest.t));
  }
  if (!holds_discs(level)) {
    EXPECT_NEAR(static_cast<double>(hit.u), named.u, 1e-3);
    EXPECT_NEAR(static_cast<double>(hit.v), named.v, 1e-3);
  }
}

void expect_level(const Level& level, Random& random) {
  const Device device = Device::open();
  const TileTracer tracer = make_tile_tracer(device, level);
  const Vec3f middle = level.bounds.center();
  const float size = level.bounds.diagonal();
  std::normal_distribution<float> normal;
  const auto direction = [&] { return normalized(Vec3f{normal(random), normal(random), normal(random)}); };
  std::vector<Ray> rays;
  for (int i = 0; i < 1000; ++i) {
    const Vec3f from = middle + direction() * (i % 4 == 0 ? 0.1f : 2.0f) * size;
    rays.push_back(make_ray(from, middle + direction() * 0.4f * size - from));
  }
  const std::vector<Hit> hits = cast(tracer, rays), any = cast(tracer, rays, RayQuery::kAny);
  std::size_t found = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    found += is_hit(hits[i]);
    expect_hit(level, rays[i], hits[i]);
    EXPECT_EQ(is_hit(hits[i]), is_hit(any[i]));
  }
  EXPECT_GT(found, 300u);
  const CameraRays camera = camera_rays(
      views_around({Vec3d(level.bounds.lo), Vec3d(level.bounds.hi)}, {0, 0, 1}, 1, 1.0)[0], 40, 40);
  const Buffer<Hit> pixels(device, 40 * 40);
  tracer.intersect(camera, pixels);
  const std::vector<Hit> seen = pixels.read();
  for (std::uint32_t i = 0; i < seen.size(); ++i)
    expect_hit(level,
               make_ray({camera.position[0], camera.position[1], camera.position[2]},
                        pixel_direction(camera, i % 40, i / 40)),
               seen[i]);
}

TEST_F(LeafBlock, TrianglesAnywhereAreHitAsBruteForceHitsThem) {
  const Level level = level_of(bumpy_sphere(40), 0);
  EXPECT_EQ(make_level_tree(level).block_options, "");
  expect_level(level, random);
}

TEST_F(LeafBlock, TrianglesOnALatticeAreHitAsBruteForceHitsThem) {
  const Level level = level_of(bumpy_sphere(40), 1e-4f);
  ASSERT_GT(level.lattice.step, 0);
  EXPECT_EQ(make_level_tree(level).block_options, " -DLATTICE");
  expect_level(level, random);
}

TEST_F(LeafBlock, DiscsAreHitAsBruteForceHitsThem) {
  const Level level = level_of(noisy_discs(40, random()), 1e-4f);
  EXPECT_EQ(make_level_tree(level).block_options, " -DDISCS");
  expect_level(level, random);
}

TEST_F(LeafBlock, TrianglesAcrossTheWholeLatticeNeedFloats) {
  Scan scan = bumpy_sphere(20);
  const auto n = static_cast<std::uint32_t>(scan.positions.size());
  scan.positions.insert(scan.positions.end(), {{-1, -1, 0}, {1, -1, 0.1f}, {0, 1, 0}});
  if (!scan.normals.empty()) scan.normals.resize(n + 3, {0, 0, 1});
  scan.triangles.push_back({n, n + 1, n + 2});
  const Level level = level_of(scan, 4e-6f);  // a million steps
  ASSERT_GT(level.lattice.step, 0);
  EXPECT_EQ(make_level_tree(level).block_options, "");
  expect_level(level, random);
}

TEST_F(LeafBlock, SharedEdgesOfDifferentBlocksLetNoRayThrough) {
  // Closed, and rays from inside at points of edges.
  const Level level = level_of(bumpy_sphere(60), 5e-5f);
  const Scan& scan = level.primitives;
  std::uniform_real_distribution<float> at(0, 1);
  std::vector<Ray> rays;
  for (const Triangle& t : scan.triangles) {
    const Vec3f a = scan.positions[t[0]], b = scan.positions[t[1]];
    const Vec3f from{0.05f * at(random), 0.05f * at(random), 0.05f * at(random)};
    for (int i = 0; i < 4; ++i) rays.push_back(make_ray(from, a + (b - a) * at(random) - from));
  }
  ASSERT_GT(rays.size(), 10000u);
  std::size_t lost = 0;
  for (const Hit& hit : cast(make_tile_tracer(Device::open(), level), rays)) lost += !is_hit(hit);
  EXPECT_EQ(lost, 0u);
}

}  // namespace
}  // namespace rbvh
