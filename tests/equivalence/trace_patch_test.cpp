// Proxies traced untessellated against their tessellated references, ray by ray: the reference traced
// exactly, whose hits they must have to the last bit, and brute force in double precision that shares no code
// with either. Closed proxies let no ray out, whatever the levels of their patches; every way of tracing
// finds the same.
#include "pipeline/trace/trace_patch.h"

#include <gtest/gtest.h>

#include <optional>

#include "pipeline/base/error.h"
#include "pipeline/device/device.h"
#include "pipeline/proxy/check_proxy.h"
#include "pipeline/proxy/tessellate.h"
#include "pipeline/trace/trace_exact.h"
#include "rbvh/camera.h"
#include "tests/proxy_shapes.h"
#include "tests/trace_test.h"

namespace rbvh {
namespace {

/// A tessellated proxy and where its triangles come from.
struct Reference {
  Scan mesh;
  std::vector<std::uint32_t> patches;
  ExactTracer tracer;
};

Reference make_reference(const Device& device, const Proxy& proxy, const std::vector<PatchLevel>& levels) {
  Reference reference;
  reference.mesh = tessellate(proxy, levels, &reference.patches);
  reference.tracer = make_exact_tracer(device, reference.mesh);
  return reference;
}

Proxy mushroom_ball(std::uint32_t n, std::vector<std::uint32_t> levels) {
  return displaced(quad_sphere(n), levels,
                   [](Vec3f p) { return mushrooms(p, 0.15f) + ripples(p, 20, 2) * 0.01f; });
}

/// A level of 0 to `most` for every quad of a sphere.
std::vector<std::uint32_t> random_levels(Random& random, std::size_t count, std::uint32_t most) {
  std::vector<std::uint32_t> levels(count);
  for (std::uint32_t& level : levels) level = static_cast<std::uint32_t>(random() % (most + 1));
  return levels;
}

class TracePatch : public TraceTest {
 protected:
  Device device = Device::open();

  /// The same t to the last bit, the same patch unless two are equally near, the same normal and side.
  void expect_same(const Reference& reference, const std::vector<Ray>& rays, const std::vector<Hit>& hits,
                   double most_on_borders = 0.02) {
    const std::vector<Hit> exact = cast(reference.tracer, rays);
    std::size_t other_patch = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(hits[i].t, exact[i].t) << "ray " << i;
      ASSERT_EQ(is_hit(hits[i]), is_hit(exact[i])) << "ray " << i;
      if (!is_hit(hits[i])) {
        ASSERT_EQ(hits[i].flags, 0u);
        continue;
      }
      if (hits[i].leaf != reference.patches[exact[i].leaf]) {
        ++other_patch;  // on a border, where both are as near
        continue;
      }
      const float along = dot(normal_of(hits[i]), normal_of(exact[i]));
      if (along < 0.9999f) {
        ++other_patch;  // on an edge of micro-quads
        continue;
      }
      ASSERT_EQ(hits[i].flags & RBVH_HIT_BACK_FACE, exact[i].flags & RBVH_HIT_BACK_FACE) << "ray " << i;
      ASSERT_GE(hits[i].u, 0.0f);
      ASSERT_LE(hits[i].u, 1.0f);
      ASSERT_GE(hits[i].v, 0.0f);
      ASSERT_LE(hits[i].v, 1.0f);
    }
    EXPECT_LE(static_cast<double>(other_patch), most_on_borders * static_cast<double>(rays.size()));
  }

  /// Brute force: every triangle of the reference in double precision. A ray within rounding of an edge is
  /// not judged.
  void expect_right(const Reference& reference, const std::vector<Ray>& rays, const std::vector<Hit>& hits) {
    std::size_t judged = 0;
    for (std::size_t r = 0; r < rays.size(); ++r) {
      const oracle::Point o = {rays[r].origin[0], rays[r].origin[1], rays[r].origin[2]};
      const oracle::Point d = {rays[r].direction[0], rays[r].direction[1], rays[r].direction[2]};
      double nearest = kInfinity;
      bool doubt = false;
      for (const Triangle& t : reference.mesh.triangles) {
        const oracle::Meeting m = oracle::intersect_triangle(point(reference.mesh.positions[t[0]]),
                                                             point(reference.mesh.positions[t[1]]),
                                                             point(reference.mesh.positions[t[2]]), o, d);
        if (!m.crosses) continue;
        doubt =
            doubt || (std::abs(m.inside) < 1e-3 && m.t > rays[r].tmin - 1e-3 && m.t < rays[r].tmax + 1e-3);
        if (m.inside >= 0 && m.t >= rays[r].tmin && m.t <= rays[r].tmax) nearest = std::min(nearest, m.t);
      }
      if (doubt) continue;
      ++judged;
      if (nearest == kInfinity) {
        ASSERT_FALSE(is_hit(hits[r])) << "ray " << r;
      } else {
        ASSERT_NEAR(hits[r].t, nearest, 1e-4 * std::max(1.0, std::abs(nearest))) << "ray " << r;
      }
    }
    EXPECT_GE(judged, rays.size() / 3);
  }

  /// Rays from inside a closed surface, at its vertices, edges, and anywhere.
  void expect_closed(const PatchTracer& tracer, const Reference& reference) {
    std::vector<Ray> rays;
    for (const Vec3f& o : {Vec3f{0, 0, 0}, Vec3f{0.1f, 0.2f, -0.15f}}) {
      for (int i = 0; i < 4000; ++i) {
        const Triangle& t = reference.mesh.triangles[random() % reference.mesh.triangles.size()];
        const Vec3f &a = reference.mesh.positions[t[0]], &b = reference.mesh.positions[t[1]];
        rays.push_back(make_ray(o, a - o));
        rays.push_back(make_ray(o, a + (b - a) * uniform(random, 0, 1) - o));
        rays.push_back(make_ray(o, uniform_direction(random)));
      }
    }
    const std::vector<Hit> hits = cast(tracer, rays);
    for (std::size_t i = 0; i < rays.size(); ++i) ASSERT_TRUE(is_hit(hits[i])) << "ray " << i << " gets out";
  }
};

TEST_F(TracePatch, HitsAreTheReferencesAtEveryLevel) {
  for (const std::uint32_t level : {0u, 1u, 2u, 3u, 4u, 5u}) {
    SCOPED_TRACE(level);
    const Proxy proxy = mushroom_ball(level < 3 ? 6 : 3, {level});
    const PatchTracer tracer = make_patch_tracer(device, proxy);
    const Reference reference = make_reference(device, proxy, levels_in_use(tracer));
    const std::vector<Ray> rays = random_rays(random, reference.mesh, 2000),
                           edges = exact_rays(random, reference.mesh, 500);
    const std::vector<Hit> hits = cast(tracer, rays);
    expect_same(reference, rays, hits);
    expect_same(reference, edges, cast(tracer, edges), 1);  // all of them at vertices
    if (level < 3) expect_right(reference, {rays.begin(), rays.begin() + 200}, hits);
    expect_closed(tracer, reference);
    if (HasFailure()) return;
  }
}

TEST_F(TracePatch, PatchesOfDifferentLevelsDoNotCrack) {
  const QuadMesh sphere = quad_sphere(4);
  for (int repetition = 0; repetition < 3; ++repetition) {
    // Tiles of one level, shown at several; and tiles of several levels, some with a single micro-quad.
    for (const bool tiles_differ : {false, true}) {
      SCOPED_TRACE(tiles_differ ? "tiles differ" : "levels differ");
      const Proxy proxy = mushroom_ball(
          4, tiles_differ ? random_levels(random, sphere.quads.size(), 5) : std::vector<std::uint32_t>{5});
      const PatchTracer tracer = make_patch_tracer(device, proxy);
      std::optional<CameraRays> camera_used;
      if (!tiles_differ) {  // a camera so near that some patches are seen finer than others
        CameraWords words;
        words.position = Vec3d{0.2, 0.3, 1.5};
        words.focal_point = Vec3d{0, 0, 0};
        words.view_angle = 60;
        const Camera camera = place_camera(words, {{-1, -1, -1}, {1, 1, 1}}, {0, 1, 0}, 1);
        camera_used = camera_rays(camera, 16, 16);
        set_detail(tracer, *camera_used);
        const std::vector<PatchLevel> levels = levels_in_use(tracer);
        std::uint32_t least = 9, most = 0;
        for (const PatchLevel& level : levels) {
          least = std::min(least, level.level);
          most = std::max(most, level.level);
        }
        ASSERT_LT(least, most);
        resolve_everything(tracer);
      }
      const Reference reference = make_reference(device, proxy, levels_in_use(tracer));
      expect_closed(tracer, reference);
      const std::vector<Ray> rays = random_rays(random, reference.mesh, 1500);
      expect_same(reference, rays, cast(tracer, rays));
      if (!tiles_differ) {
        ProxyConfig config;
        config.few_rays = 1000000;
        config.at_once = false;
        const PatchTracer unbuilt = make_patch_tracer(device, proxy, config);
        set_detail(unbuilt, *camera_used);
        resolve_everything(unbuilt);
        expect_same(reference, rays, cast(unbuilt, rays));
        EXPECT_GT(stats(unbuilt).unbuilt_rays, 0u);
      }
      if (HasFailure()) return;
    }
  }
}

TEST_F(TracePatch, NothingDependsOnHowItIsTraced) {
  const Proxy proxy = mushroom_ball(3, {4});
  const PatchTracer usual = make_patch_tracer(device, proxy);
  const Reference reference = make_reference(device, proxy, levels_in_use(usual));
  const std::vector<Ray> rays = random_rays(random, reference.mesh, 3000);
  ProxyConfig gathered, one_item, many_items, small_cache, nothing_kept, unbuilt, alone;
  gathered.at_once = false;
  one_item.items = 1;
  many_items.at_once = false;
  many_items.items = kMostItems;
  small_cache.cache_bytes = 40000;  // three patches
  nothing_kept.keep = false;
  unbuilt.few_rays = 1000000;
  unbuilt.keep = unbuilt.at_once = false;
  alone.packets = false;
  const auto check = [&](const Device& on, const ProxyConfig& config, const char* name) {
    SCOPED_TRACE(name);
    const PatchTracer tracer = make_patch_tracer(on, proxy, config);
    for (int frame = 0; frame < 2; ++frame) expect_same(reference, rays, cast(tracer, rays));
    const std::vector<Hit> nearest = cast(tracer, rays), any = cast(tracer, rays, RayQuery::kAny);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(is_hit(any[i]), is_hit(nearest[i])) << "ray " << i;
      ASSERT_GE(any[i].t, nearest[i].t) << "ray " << i;
    }
    EXPECT_LE(bytes(tracer).cached, config.cache_bytes);
  };
  check(device, {}, "usual");
  check(device, alone, "no packets");
  check(device, gathered, "gathered");
  check(device, one_item, "one work item a round");
  check(device, many_items, "many work items a round");
  check(device, small_cache, "small cache");
  check(device, nothing_kept, "nothing cached");
  check(device, unbuilt, "nothing built");
  check(device.as_gpu(), unbuilt, "a GPU's code, nothing built");
  check(device.as_gpu(), gathered, "a GPU's code, gathered");
  check(device.as_gpu(), {}, "a GPU's code");
}

// Coherent neighbours are cast 16 at a time, and so are those that are nearly coherent, hit nothing, or end
// early.
TEST_F(TracePatch, CoherentRaysFindWhatEachFindsAlone) {
  const std::vector<std::uint32_t> mixed = random_levels(random, quad_sphere(3).quads.size(), 6);
  for (const std::vector<std::uint32_t>& levels : {std::vector<std::uint32_t>{5}, {4}, mixed}) {
    const Proxy proxy = mushroom_ball(3, levels);
    const PatchTracer tracer = make_patch_tracer(device, proxy);
    const Reference reference = make_reference(device, proxy, levels_in_use(tracer));
    std::vector<Ray> rays;
    for (int beam = 0; beam < 400; ++beam) {
      const bool is_axial = beam % 5 == 0;
      const Vec3f along = is_axial ? Vec3f{beam % 2 ? -1.0f : 1.0f, 0, 0} : uniform_direction(random);
      const Vec3f from = along * (beam % 3 == 0 ? -0.2f : -2.5f) + uniform_point(random, 0.3f);
      const float spread = beam % 4 == 0 ? 0.3f : 0.01f, apart = beam % 7 == 0 ? 0.01f : 0.0f;
      for (int i = 0; i < (beam % 11 == 0 ? 13 : 16); ++i) {
        Ray ray = make_ray(from + uniform_point(random, apart), along + uniform_point(random, spread));
        if (beam % 6 == 0) ray.tmin = uniform(random, -1, 1);
        if (beam % 6 == 1) ray.tmax = uniform(random, 0, 3);
        if (beam % 13 == 0 && i % 5 == 2) ray.direction[1] = kNan;
        if (is_axial && i % 3 == 0) ray.direction[2] = 0;
        rays.push_back(ray);
      }
    }
    for (int frame = 0; frame < 2; ++frame) expect_same(reference, rays, cast(tracer, rays));
    const Buffer<Ray> ray_buffer(device, rays);
    const Buffer<Hit> hits(device, rays.size());
    for (const std::uint32_t row : {1u, 2u, 37u, 40u, 6000u, 7000u}) {  // whatever the rows
      intersect_rows(tracer, ray_buffer, hits, rays.size(), RayQuery::kNearest, nullptr, row);
      expect_same(reference, rays, hits.read());
    }
    if (HasFailure()) return;
  }
}

TEST_F(TracePatch, DeepLevelsFollowComputedLinks) {
  const std::uint32_t level = PATCH_LINKED_LEVEL + 1;
  const Proxy proxy = displaced(quad_sheet(1, 1,
                                           [](float s, float t) {
                                             return Vec3f{s, t, 0};
                                           }),
                                std::span(&level, 1), [](Vec3f p) {
                                  return Vec3f{0.05f * std::sin(20 * p.y), 0, 0.1f * std::sin(9 * p.x)};
                                });
  ProxyConfig config;
  config.cache_bytes = std::size_t{16} << 20;
  const PatchTracer tracer = make_patch_tracer(device, proxy, config);
  const Reference reference = make_reference(device, proxy, levels_in_use(tracer));
  const std::vector<Ray> rays = random_rays(random, reference.mesh, 1000);
  expect_same(reference, rays, cast(tracer, rays));
  expect_same(reference, rays, cast(make_patch_tracer(device.as_gpu(), proxy, config), rays));
}

TEST_F(TracePatch, RaysThatResolveLessTakeBoxes) {
  const Proxy proxy = mushroom_ball(2, {6});
  CameraWords words;
  words.position = Vec3d{0, 0, 1.35};  // its nearest parts are much nearer than the others
  words.focal_point = Vec3d{0, 0, 0};
  words.view_angle = 100;
  const Camera camera = place_camera(words, {{-1, -1, -1}, {1, 1, 1}}, {0, 1, 0}, 1);
  const CameraRays rays = camera_rays(camera, 96, 96);
  for (const Device& on : {device, device.as_gpu()}) {
    const PatchTracer tracer = make_patch_tracer(on, proxy);
    const Buffer<Hit> buffer(device, 96 * 96);
    tracer.intersect(rays, buffer);
    const std::vector<Hit> hits = buffer.read();
    const Reference reference = make_reference(device, proxy, levels_in_use(tracer));
    const Buffer<Hit> exact_buffer(device, 96 * 96);
    reference.tracer.intersect(rays, exact_buffer);
    const std::vector<Hit> exact = exact_buffer.read();
    std::size_t holes = 0, fat = 0, far = 0, found = 0;
    const double pixel = length(Vec3d{rays.right[0], rays.right[1], rays.right[2]});
    for (std::size_t i = 0; i < hits.size(); ++i) {
      if (is_hit(exact[i]) && !is_hit(hits[i])) ++holes;
      if (!is_hit(exact[i]) && is_hit(hits[i])) ++fat;
      if (!is_hit(exact[i]) || !is_hit(hits[i])) continue;
      ++found;
      // A box is no larger than four pixels (two levels), with its surface somewhere inside.
      EXPECT_LE(hits[i].t, exact[i].t * (1 + 1e-5f));
      if (std::abs(hits[i].t - exact[i].t) > 8 * pixel * exact[i].t) ++far;
      EXPECT_NEAR(length(normal_of(hits[i])), 1, 1e-3);
    }
    EXPECT_EQ(holes, 0u);
    EXPECT_LE(fat, found / 20);
    EXPECT_LE(far, found / 20);
  }
}

TEST_F(TracePatch, InstancesAreTheMovedMesh) {
  const Proxy ball = mushroom_ball(2, {4});
  const Proxy sheet =
      displaced(quad_sheet(3, 2,
                           [](float s, float t) {
                             return Vec3f{3 * s, -1, 3 * t};
                           }),
                std::vector<std::uint32_t>{3}, [](Vec3f p) { return ripples(p, 5, 2) * 0.1f; });
  std::vector<ProxyInstance> instances;
  const auto add = [&](std::uint32_t proxy, std::array<double, 12> m) {
    const std::uint32_t first = instances.empty() ? 5 : instances.back().first_leaf + 100;
    instances.push_back({proxy, {m}, first});
  };
  add(0, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0});
  add(0, {0.5, 0, 0, 2, 0, 0.5, 0, 0.5, 0, 0, 0.5, 0});
  add(0, {0, -1.5, 0.2, -1, 0.7, 0, 0, 2, 0, 0.3, 1, -2});  // sheared and turned
  add(1, {1, 0, 0, -1, 0, 1, 0, -1, 0, 0, 1, 0});
  const Proxy* const proxies[] = {&ball, &sheet};
  for (const bool at_once : {true, false}) {
    ProxyConfig config;
    config.at_once = at_once;
    const PatchTracer tracer = make_patch_tracer(device, proxies, instances, config);
    Scan mesh;
    std::vector<std::uint32_t> leaves;
    for (const ProxyInstance& instance : instances) {
      std::vector<std::uint32_t> patches;
      const Scan one = tessellate(*proxies[instance.proxy], levels_in_use(tracer, instance.proxy), &patches);
      const auto first = static_cast<std::uint32_t>(mesh.positions.size());
      for (const Vec3f& p : one.positions)
        mesh.positions.push_back(static_cast<Vec3f>(instance.to_world.point(static_cast<Vec3d>(p))));
      for (std::size_t t = 0; t < one.triangles.size(); ++t) {
        mesh.triangles.push_back(
            {one.triangles[t][0] + first, one.triangles[t][1] + first, one.triangles[t][2] + first});
        leaves.push_back(instance.first_leaf + patches[t]);
      }
    }
    const ExactTracer exact = make_exact_tracer(device, mesh);
    const std::vector<Ray> rays = random_rays(random, mesh, 8000);
    const std::vector<Hit> hits = cast(tracer, rays), reference = cast(exact, rays);
    std::size_t differing = 0, found = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      found += is_hit(reference[i]);
      const bool same = is_hit(hits[i]) == is_hit(reference[i]) &&
                        (!is_hit(hits[i]) ||
                         (hits[i].leaf == leaves[reference[i].leaf] &&
                          std::abs(hits[i].t - reference[i].t) <= 1e-4f * std::abs(reference[i].t) + 1e-5f &&
                          dot(normal_of(hits[i]), normal_of(reference[i])) > 0.99f));
      differing += !same;
    }
    EXPECT_GT(found, 1000u);
    EXPECT_LE(differing, found / 200);  // where rounding decides: silhouettes and edges
  }
}

TEST_F(TracePatch, ACacheThatHoldsNoPatchIsRefusedOrDoneWithout) {
  ProxyConfig config;
  config.cache_bytes = 1000;
  const Proxy large = mushroom_ball(1, {5});
  const PatchTracer slow = make_patch_tracer(device, large, config);
  const Reference reference = make_reference(device, large, levels_in_use(slow));
  const std::vector<Ray> rays = random_rays(random, reference.mesh, 300);
  expect_same(reference, rays, cast(slow, rays));
  EXPECT_EQ(stats(slow).built, 0u);
  const Proxy proxy = mushroom_ball(1, {3});
  const PatchTracer tracer = make_patch_tracer(device, proxy, config);
  try {
    cast(tracer, {make_ray({0, 0, 3}, {0, 0, -1})});
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kBudget);
    EXPECT_NE(std::string(error.what()).find("patch cache"), std::string::npos) << error.what();
  }
}

TEST_F(TracePatch, FewRaysIntersectPatchesUnbuilt) {
  const Proxy proxy = mushroom_ball(3, {5});
  const PatchTracer tracer = make_patch_tracer(device, proxy);
  const Reference reference = make_reference(device, proxy, levels_in_use(tracer));
  const std::vector<Ray> rays = random_rays(random, reference.mesh, 40);
  for (int i = 0; i < 5; ++i) {  // again and again: then it is built after all
    expect_same(reference, rays, cast(tracer, rays), 0.1);
    if (i == 0) {
      EXPECT_GT(stats(tracer).unbuilt_rays, 10u);
    }
  }
  EXPECT_GT(stats(tracer).built, 0u);
}

TEST_F(TracePatch, TheCacheServesLaterCasts) {
  const Proxy proxy = mushroom_ball(3, {4});
  const PatchTracer tracer = make_patch_tracer(device, proxy);
  const Reference reference = make_reference(device, proxy, levels_in_use(tracer));
  const std::vector<Ray> rays = random_rays(random, reference.mesh, 5000);
  std::vector<std::uint32_t> steps;
  const std::vector<Hit> first = cast(tracer, rays, RayQuery::kNearest, &steps);
  EXPECT_GT(stats(tracer).built, 0u);
  EXPECT_LE(stats(tracer).built, proxy.quads.size());
  stats(tracer) = {};
  const std::vector<Hit> second = cast(tracer, rays, RayQuery::kNearest, &steps);
  EXPECT_EQ(stats(tracer).items, 0u);
  EXPECT_EQ(stats(tracer).built, 0u);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    ASSERT_EQ(first[i].t, second[i].t);
    if (is_hit(second[i])) {
      ASSERT_GT(steps[i], 1u);
    }
  }
  set_detail(tracer, 3);
  cast(tracer, rays);
  EXPECT_GT(stats(tracer).built, 0u);
  const Reference coarse = make_reference(device, proxy, levels_in_use(tracer));
  expect_same(coarse, rays, cast(tracer, rays));
}

TEST_F(TracePatch, NoRaysAndNoPatches) {
  const Proxy proxy = mushroom_ball(1, {2});
  EXPECT_TRUE(cast(make_patch_tracer(device, proxy), {}).empty());
  const Proxy none;
  const std::vector<Hit> hits = cast(make_patch_tracer(device, none), {make_ray({0, 0, 3}, {0, 0, -1})});
  EXPECT_FALSE(is_hit(hits[0]));
}

}  // namespace
}  // namespace rbvh
