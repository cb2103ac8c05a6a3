// The RBVH against brute force over the triangles it was built from, ray by ray, and its kernels against each
// other.
#include "pipeline/trace/trace_tile.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>

#include "pipeline/base/error.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/scan/vertex_normals.h"
#include "pipeline/trace/camera_rays.h"
#include "rbvh/camera.h"
#include "tests/build_levels.h"
#include "tests/exact_scenes.h"
#include "tests/property.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

std::vector<Hit> trace(const Level& level, const std::vector<Ray>& rays,
                       RayQuery query = RayQuery::kNearest) {
  const Device device = Device::open();
  const TileTracer tracer = make_tile_tracer(device, level);
  const Buffer<Hit> hits(device, rays.size());
  tracer.intersect(Buffer<Ray>(device, rays), hits, rays.size(), query);
  return hits.read();
}

struct Exact {
  double t = std::numeric_limits<double>::infinity();
  double inside = -1;  ///< least barycentric coordinate of the hit triangle
  double slope = 0;    ///< |cosine| between ray and surface
  oracle::Point normal{};
  double behind = std::numeric_limits<double>::infinity();  ///< t of the next primitive that is hit
};

Exact brute_force(const Scan& scan, const Ray& r) {
  const oracle::Point o{r.origin[0], r.origin[1], r.origin[2]},
      d{r.direction[0], r.direction[1], r.direction[2]};
  Exact best;
  const auto take = [&](const oracle::Meeting& m) {
    if (!m.crosses || m.inside < 0 || m.t <= r.tmin) return;
    if (m.t >= best.t) {
      best.behind = std::min(best.behind, m.t);
      return;
    }
    best = {m.t, m.inside, std::abs(oracle::dot(m.normal, d)) / std::sqrt(oracle::dot(d, d)), m.normal,
            best.t};
  };
  for (const Triangle& t : scan.triangles)
    take(oracle::intersect_triangle(point(scan.positions[t[0]]), point(scan.positions[t[1]]),
                                    point(scan.positions[t[2]]), o, d));
  for (std::size_t i = 0; scan.is_cloud() && i < scan.positions.size(); ++i)
    take(oracle::intersect_disc(point(scan.positions[i]), point(scan.normals[i]),
                                static_cast<double>(scan.radii[i]), o, d));
  return best;
}

std::vector<Ray> rays_at_sphere(std::size_t count, std::uint64_t seed, bool from_inside) {
  std::mt19937_64 random(seed);
  std::normal_distribution<float> normal;
  const auto direction = [&] { return normalized(Vec3f{normal(random), normal(random), normal(random)}); };
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f target = direction() * 0.9f;
    const Vec3f from = from_inside ? direction() * 0.3f : direction() * 3.0f;
    rays.push_back(make_ray(from, target - from));
  }
  return rays;
}

TEST(TraceTile, FollowsABumpySphereFromOutsideAndInside) {
  const Scan scan = bumpy_sphere(60);
  const Level level = build(scan, {{"Q", 3e5f, 0.85f, 45}}).levels[0];
  for (const bool from_inside : {false, true}) {
    const std::vector<Ray> rays = rays_at_sphere(1500, property_seed(), from_inside);
    const std::vector<Hit> hits = trace(level, rays);
    std::vector<double> errors;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Exact exact = brute_force(scan, rays[i]);
      // Rays that graze the sphere may rightly miss a surface that is a texel's error off.
      if (!std::isfinite(exact.t) || exact.slope < 0.1) continue;
      ASSERT_TRUE(std::isfinite(hits[i].t)) << "ray " << i;
      const double error = std::abs(hits[i].t - exact.t) * exact.slope;
      EXPECT_LT(error, 1.5e-2) << "ray " << i;
      errors.push_back(error);
      EXPECT_EQ((hits[i].flags & RBVH_HIT_BACK_FACE) != 0, from_inside) << "ray " << i;
      EXPECT_EQ(hits[i].flags & RBVH_HIT_ON_PRIMITIVE, 0u);
      EXPECT_LT(hits[i].leaf, level.leaves.size());
      EXPECT_NEAR(hits[i].normal[0] * hits[i].normal[0] + hits[i].normal[1] * hits[i].normal[1] +
                      hits[i].normal[2] * hits[i].normal[2],
                  1, 1e-5);
    }
    ASSERT_GT(errors.size(), 1000u);
    std::sort(errors.begin(), errors.end());
    EXPECT_LT(errors[errors.size() / 2], 2e-4);  // a texel is 7e-3
  }
}

TEST(TraceTile, BeamsAndSingleRaysAgree) {
  const Level level = build(bumpy_sphere(100), {{"Q", 1e6f, 0.85f, 45}}).levels[0];
  const Bounds3d box = to_double(level.bounds);
  const CameraRays camera =
      camera_rays(views_around(box, {0, 0, 1}, 1, 1.0)[0], 203, 101);  // no multiple of 8
  std::vector<Ray> rays;
  for (std::uint32_t y = 0; y < camera.height; ++y)
    for (std::uint32_t x = 0; x < camera.width; ++x)
      rays.push_back(make_ray({camera.position[0], camera.position[1], camera.position[2]},
                              pixel_direction(camera, x, y)));
  const std::vector<Hit> single = trace(level, rays);
  const Device device = Device::open();
  const Buffer<Hit> hits(device, rays.size());
  make_tile_tracer(device, level).intersect(camera, hits);
  const std::vector<Hit> beams = hits.read();
  std::size_t hit_count = 0, differ = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    hit_count += std::isfinite(single[i].t);
    if (std::isfinite(single[i].t) != std::isfinite(beams[i].t) ||
        (std::isfinite(single[i].t) && std::abs(single[i].t - beams[i].t) > 1e-4f * single[i].t))
      ++differ;
  }
  EXPECT_GT(hit_count, rays.size() / 10);
  EXPECT_LE(differ, rays.size() / 5000);  // rounding at silhouettes
}

TEST(TraceTile, HybridChoosesWhichLeavesFallBack) {
  // Some 20 texels a triangle: where it is fine, the triangles are the fewer bytes.
  const Scan scan = bumpy_sphere(60);
  const auto level_of = [&](float rho, Hybrid hybrid) {
    return build(scan, {{"Q", rho, 0.85f, 45}}, Refinement::kProjectedArea, hybrid).levels[0];
  };
  EXPECT_EQ(level_of(2e5f, Hybrid::kOff).primitive_leaves.size(), 0u);
  EXPECT_GT(level_of(2e5f, Hybrid::kAuto).primitive_leaves.size(), 20u);
  const Level coarse = level_of(2e4f, Hybrid::kAuto);
  EXPECT_LT(coarse.primitive_leaves.size(), coarse.leaves.size() / 4);
  const Level level = level_of(2e4f, Hybrid::kAlways);
  EXPECT_EQ(level.primitive_leaves.size(), level.leaves.size());
  EXPECT_EQ(level.primitives.triangles.size(), scan.triangles.size());
  const std::vector<Ray> rays = rays_at_sphere(500, property_seed(), false);
  const std::vector<Hit> hits = trace(level, rays);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Exact exact = brute_force(scan, rays[i]);
    if (!std::isfinite(exact.t) || exact.slope < 0.02) continue;
    EXPECT_NEAR(hits[i].t, exact.t, 1e-5 * exact.t) << i;
    EXPECT_NE(hits[i].flags & RBVH_HIT_ON_PRIMITIVE, 0u) << i;
  }
}

TEST(TraceTile, LeavesThatFellBackAreHitExactly) {
  const std::uint64_t seed = property_seed();
  for (const Scan& scan : {thicket(400, seed), noisy_discs(40, seed)}) {
    const Level level = build(scan, {{"Q", 4e4f, 0.85f, 45}}, Refinement::kProjectedArea,
                              scan.is_cloud() ? Hybrid::kAlways : Hybrid::kAuto)
                            .levels[0];
    ASSERT_GT(level.primitive_leaves.size(), 20u);
    EXPECT_EQ(level.primitives.is_cloud(), scan.is_cloud());
    const std::vector<Ray> rays = rays_at_sphere(1500, seed, false);
    const std::vector<Hit> hits = trace(level, rays), any = trace(level, rays, RayQuery::kAny);
    // Single triangles of the thicket are tiles: their outlines are a texel's error off.
    const double well_inside = scan.is_cloud() ? 1e-3 : 0.2;
    std::size_t exact_hits = 0, lost = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      EXPECT_EQ(std::isfinite(hits[i].t), std::isfinite(any[i].t)) << i;
      const Exact exact = brute_force(scan, rays[i]);
      lost += std::isfinite(exact.t) && exact.inside > well_inside && !std::isfinite(hits[i].t);
      if ((hits[i].flags & RBVH_HIT_ON_PRIMITIVE) == 0) continue;
      ++exact_hits;
      // A tile in front, or a ray along an edge, may differ; what is hit here is one of the scan's
      // primitives.
      if (exact.inside < well_inside || hits[i].t < exact.t - 1e-4) continue;
      if (exact.behind - exact.t < 1e-5) continue;  // where two cross, rounding decides which is in front
      if (std::abs(hits[i].t - exact.t) < 1e-4)
        EXPECT_NEAR(std::abs(hits[i].normal[0] * exact.normal[0] + hits[i].normal[1] * exact.normal[1] +
                             hits[i].normal[2] * exact.normal[2]),
                    1, 1e-3)
            << i;
      else
        ++lost;
    }
    EXPECT_GT(exact_hits, 200u);
    EXPECT_LE(lost, rays.size() / 500);
  }
}

TEST(TraceTile, NoRaySlipsBetweenExactPrimitives) {
  // A crumpled sheet, whose one leaf falls back to exact triangles, and rays from afar at points of the edges
  // that triangles share.
  Scan scan;
  std::mt19937_64 random(property_seed());
  std::uniform_real_distribution<float> at(0, 1);
  add_sheet(scan, 10, [&](float s, float t) { return Vec3f{0.01f * s, 0.01f * t, 0.0005f * at(random)}; });
  Level level = build(scan, {{"Q", 1e3f, 0.85f, 45}}).levels[0];
  level.leaves.resize(1);
  level.leaves[0].primitives = static_cast<std::uint32_t>(scan.triangles.size());
  level.nodes = {{{-1e-4f, -1e-4f, -1e-4f}, 0, {0.0101f, 0.0101f, 0.0006f}, 1}};
  level.primitive_leaves = {{0, 0}};
  level.primitives = scan;
  level.primitives.normals = vertex_normals(scan);
  std::vector<Ray> rays;
  for (const Triangle& t : scan.triangles) {
    for (int i = 0; i < 100; ++i) {
      const Vec3f a = scan.positions[t[0]], b = scan.positions[t[1]], p = a + (b - a) * at(random);
      if (p.x < 0.001f || p.x > 0.009f || p.y < 0.001f || p.y > 0.009f) continue;
      const Vec3f from{0.5f + at(random), at(random), 2.5f};
      rays.push_back(make_ray(from, p - from));
    }
  }
  ASSERT_GT(rays.size(), 5000u);
  std::size_t lost = 0;
  for (const Hit& hit : trace(level, rays)) lost += !std::isfinite(hit.t);
  EXPECT_EQ(lost, 0u);
}

TEST(TraceTile, AMapToTheTileThatIsTooLargeDoesNotHang) {
  Level level = build(bumpy_sphere(20), {{"Q", 1e4f, 0.85f, 45}}).levels[0];
  for (RbvhLeaf& leaf : level.leaves)
    for (float& value : leaf.to_tile) value *= 1e15f;
  const Bounds3d box = to_double(level.bounds);
  const Device device = Device::open();
  const Buffer<Hit> hits(device, 64 * 64);
  make_tile_tracer(device, level)
      .intersect(camera_rays(views_around(box, {0, 0, 1}, 1, 1.0)[0], 64, 64), hits);
  EXPECT_EQ(hits.read().size(), 64u * 64);
}

TEST(TraceTile, AnyHitAgreesAndIntervalsAreKept) {
  const Level level = build(bumpy_sphere(40), {{"Q", 1e5f, 0.85f, 45}}).levels[0];
  const std::vector<Ray> rays = rays_at_sphere(2000, property_seed(), false);
  const std::vector<Hit> nearest = trace(level, rays), any = trace(level, rays, RayQuery::kAny);
  std::vector<Ray> shorter = rays, later = rays;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    EXPECT_EQ(std::isfinite(nearest[i].t), std::isfinite(any[i].t)) << i;
    shorter[i].tmax = 0.99f * nearest[i].t;
    later[i].tmin = 1.01f * nearest[i].t;
  }
  const std::vector<Hit> before = trace(level, shorter), behind = trace(level, later);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!std::isfinite(nearest[i].t)) continue;
    EXPECT_FALSE(std::isfinite(before[i].t)) << i;
    EXPECT_GT(behind[i].t, nearest[i].t) << i;
  }
}

TEST(TraceTile, HitsPlatesSquarelyAndUnevenRaysMiss) {
  Scan scan;
  add_plate(scan, 8, 0.25f);
  const Level level = build(scan, {{"Q", 1e4f, 0.85f, 45}}).levels[0];
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<Hit> hits =
      trace(level, {make_ray({0.1f, 0.2f, 2}, {0, 0, -1}), make_ray({0.1f, 0.2f, -2}, {0, 0, 4}),
                    make_ray({0.1f, 0.2f, 2}, {0, 0, 1}), make_ray({0.1f, 0.2f, 2}, {0, 0, 0}),
                    make_ray({nan, 0, 2}, {0, 0, -1}), make_ray({0, 0, 2}, {0, nan, -1}),
                    make_ray({-2, 0, 0.25f}, {1, 0, 0}), make_ray({-0.491f, -0.491f, 2}, {0, 0, -1}),
                    make_ray({0.51f, 0, 2}, {0, 0, -1}), make_ray({0.1f, 0.2f, 2}, {0, 0, -1e-12f}),
                    make_ray({0.1f, 0.2f, 2}, {0, 0, -1e12f}), make_ray({-0.491f, 0.3f, 2}, {0, 0, -1}),
                    make_ray({-0.1f, 0.491f, 2}, {0, 0, -1})});
  EXPECT_NEAR(hits[0].t, 1.75f, 1e-5f);
  EXPECT_EQ(hits[0].normal[2], 1.0f);
  EXPECT_NEAR(hits[1].t, 0.5625f, 1e-5f);
  EXPECT_EQ(hits[1].flags, RBVH_HIT_BACK_FACE);
  for (const std::size_t miss : {2u, 3u, 4u, 5u, 8u}) EXPECT_FALSE(std::isfinite(hits[miss].t)) << miss;
  // A corner and two boundary edges: texels end up to 0.7 texels (0.0086) before them.
  for (const std::size_t edge : {7u, 11u, 12u}) EXPECT_NEAR(hits[edge].t, 1.75f, 1e-5f) << edge;
  EXPECT_NEAR(hits[9].t, 1.75e12f, 1e7f);
  EXPECT_NEAR(hits[10].t, 1.75e-12f, 1e-17f);
}

TEST(TraceTile, EmptyBatchesAreFine) {
  const Level level = build(bumpy_sphere(8), {{"Q", 1e4f, 0.85f, 45}}).levels[0];
  EXPECT_TRUE(trace(level, {}).empty());
}

// The four faults that the first prototype ran into.

TEST(Faults, NoPrimitiveIsReferencedTwice) {
  const Scan scan = bumpy_sphere(80);
  for (const Level& level : build(scan, standard_levels()).levels) {
    std::uint64_t references = 0;
    for (const RbvhLeaf& leaf : level.leaves) references += leaf.primitives;
    EXPECT_EQ(references, scan.triangles.size()) << level.name;
  }
}

TEST(Faults, NoiseDoesNotSplitForEver) {
  std::mt19937_64 random(7);
  std::normal_distribution<float> noise;
  Scan scan;
  add_sheet(scan, 150, [&](float s, float t) {
    return Vec3f{s + 0.01f * noise(random), t + 0.01f * noise(random), 0.01f * noise(random)};
  });
  const Level level = build(scan, {{"Q", 32e3f, 0.65f, 65}}).levels[0];
  EXPECT_LT(level.leaves.size(), scan.triangles.size() / 3);
  EXPECT_LT(level.layers[0].texels.size(), 500'000u);
}

TEST(Faults, NoWallStandsInAStep) {
  // Two plates side by side, one higher; rays between their heights, along the gap's edge, must pass.
  Scan scan;
  add_sheet(scan, 20, [](float s, float t) { return Vec3f{s, t, 0}; });
  add_sheet(scan, 20, [](float s, float t) { return Vec3f{s + 1, t, 0.6f}; });
  const Level level = build(scan, {{"Q", 2e4f, 0.65f, 65}}).levels[0];
  std::vector<Ray> through, onto;
  for (int i = 0; i < 50; ++i) {
    const float z = 0.1f + 0.4f * static_cast<float>(i) / 49;
    through.push_back(make_ray({-1, 0.37f, z}, {1, 0.01f, 0}));
    onto.push_back(make_ray({0.02f + 1.96f * static_cast<float>(i) / 49, 0.5f, 3}, {0, 0, -1}));
  }
  for (const Hit& hit : trace(level, through)) EXPECT_FALSE(std::isfinite(hit.t));
  for (const Hit& hit : trace(level, onto)) EXPECT_TRUE(std::isfinite(hit.t));
}

TEST(Faults, HolesOfATexelStayOpen) {
  // A plate of cells of 1.7 texels, some of them missing.
  std::mt19937_64 random(property_seed());
  Scan scan;
  add_plate(scan, 60, 0);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < scan.triangles.size(); i += 2)
    if (random() % 60 != 0)
      for (std::size_t k = 0; k < 2; ++k) scan.triangles[kept++] = scan.triangles[i + k];
  scan.triangles.resize(kept);
  std::vector<Ray> rays;
  std::uniform_real_distribution<float> place(-0.52f, 0.52f), lean(-0.7f, 0.7f);
  for (int i = 0; i < 5000; ++i)
    rays.push_back(make_ray({place(random), place(random), 1}, {lean(random), lean(random), -1}));
  const auto mistaken = [&](Hybrid hybrid) {
    const std::vector<Hit> hits =
        trace(build(scan, {{"Q", 15000, 0.85f, 45}}, Refinement::kProjectedArea, hybrid).levels[0], rays);
    int wrong = 0;
    for (std::size_t i = 0; i < rays.size(); ++i)
      wrong += std::isfinite(hits[i].t) != std::isfinite(brute_force(scan, rays[i]).t);
    return wrong;
  };
  // Over 40 seeds 1 to 13; tiles alone, which end at whole texels, 30 to 68.
  const int with_boundary = mistaken(Hybrid::kAuto);
  EXPECT_LT(with_boundary, 25);
  EXPECT_GT(mistaken(Hybrid::kOff), with_boundary);
}

TEST(Faults, TheLowerOfTwoLayersIsNotLost) {
  Scan scan;
  add_plate(scan, 20, 0);
  add_plate(scan, 20, 0.2f);
  const Level level = build(scan, {{"Q", 2e4f, 0.65f, 65}}).levels[0];
  std::vector<Ray> down, up;
  for (int i = 0; i < 100; ++i) {
    const float x = -0.45f + 0.1f * static_cast<float>(i % 10),
                y = -0.45f + 0.1f * static_cast<float>(i / 10);
    down.push_back(make_ray({x, y, 1}, {0, 0, -1}));
    up.push_back(make_ray({x, y, -1}, {0, 0, 1}));
  }
  for (const Hit& hit : trace(level, down)) EXPECT_NEAR(hit.t, 0.8f, 1e-3f);
  for (const Hit& hit : trace(level, up)) EXPECT_NEAR(hit.t, 1.0f, 1e-3f);
}

TEST(Faults, NeitherSideOfAThinSheetIsLost) {
  Scan scan;
  add_plate(scan, 20, 0, false);
  add_plate(scan, 20, 0.004f, true);
  const Level level = build(scan, {{"Q", 2e4f, 0.65f, 65}}).levels[0];
  for (const Hit& hit :
       trace(level, {make_ray({0.1f, 0.1f, 1}, {0, 0, -1}), make_ray({0.1f, 0.1f, -1}, {0, 0, 1})})) {
    EXPECT_TRUE(std::isfinite(hit.t));
    EXPECT_EQ(hit.flags & RBVH_HIT_BACK_FACE, 0u) << "its outside was not hit first";
  }
}

/// Kernels built with bounds checks, whatever the build.
Device checking_device() {
  setenv("RBVH_CHECK_BOUNDS", "1", 1);
  const Device device = Device::open();
  unsetenv("RBVH_CHECK_BOUNDS");
  return device;
}

/// What is thrown when rays, beams and pixels are traced, by each of them or by none; empty: nothing.
std::string traced_out_of_bounds(const Device& device, const TileTracer& tracer, const Level& level) {
  const Bounds3d box = to_double(level.bounds);
  const CameraRays camera = camera_rays(views_around(box, {0, 0, 1}, 1, 1.0)[0], 32, 32);
  const Buffer<Hit> hits(device, 32 * 32);
  std::vector<Ray> rays;
  for (std::uint32_t i = 0; i < 32 * 32; ++i)
    rays.push_back(make_ray({camera.position[0], camera.position[1], camera.position[2]},
                            pixel_direction(camera, i % 32, i / 32)));
  std::vector<std::string> errors;
  const auto run = [&](auto&& trace_all) {
    errors.emplace_back();
    try {
      trace_all();
    } catch (const Error& error) {
      errors.back() = error.what();
    }
  };
  run([&] { tracer.intersect(Buffer<Ray>(device, rays), hits, rays.size(), RayQuery::kNearest); });
  run([&] { tracer.intersect(camera, hits); });
  TileTracer pixels = tracer;
  pixels.device = device.as_gpu();
  run([&] { pixels.intersect(camera, hits); });
  for (const std::string& error : errors) EXPECT_EQ(error.empty(), errors[0].empty()) << errors[0] << error;
  return errors[0];
}

TEST(TraceTile, IndicesOutOfBoundsAreCaughtWhereTheyAreChecked) {
  const Level level = build(bumpy_sphere(30), {{"Q", 1e5f, 0.85f, 45}}).levels[0];
  const Device device = checking_device();
  const TileTracer whole = make_tile_tracer(device, level);
  EXPECT_EQ(traced_out_of_bounds(device, whole, level), "");

  // Every node's children, far beyond the nodes or the blocks; an empty slot stays far away.
  constexpr std::uint32_t kFar = 1u << 24;
  for (const std::uint32_t child : {kFar, BVH_LEAF_BIT | kFar}) {
    std::vector<WideNode> nodes = whole.nodes.read();
    for (WideNode& node : nodes) std::fill(std::begin(node.children), std::end(node.children), child);
    TileTracer tracer = whole;
    tracer.nodes = Buffer<WideNode>(device, nodes);
    const std::string error = traced_out_of_bounds(device, tracer, level);
    EXPECT_NE(error.find("kernels/trace/trace_tile.cl: line "), std::string::npos) << error;
    // Leaves beyond the tiles are blocks.
    const std::uint32_t element = child == kFar ? kFar : kFar - whole.tile_count;
    EXPECT_NE(error.find("reads element " + std::to_string(element)), std::string::npos) << error;
  }

  // Tiles whose texels lie beyond the heights, or that are larger than what is left of these.
  for (const bool moved : {true, false}) {
    std::vector<RbvhTile> tiles = whole.tiles.read();
    for (RbvhTile& tile : tiles) {
      if (moved) tile.offset = 0x7fffff00u;
      if (!moved) tile.width = tile.height = 0xffff;
    }
    TileTracer tracer = whole;
    tracer.tiles = Buffer<RbvhTile>(device, tiles);
    const std::string error = traced_out_of_bounds(device, tracer, level);
    EXPECT_NE(error.find("kernels/trace/march.h: line "), std::string::npos) << error;
    EXPECT_NE(error.find("reads element"), std::string::npos) << error;
  }
}

}  // namespace
}  // namespace rbvh
