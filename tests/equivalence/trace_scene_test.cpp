// A scene of scans, a pair's level and proxies, placed and mirrored, against all of it as one mesh in the
// world.
#include "pipeline/trace/trace_scene.h"

#include <gtest/gtest.h>

#include <functional>

#include "pipeline/proxy/tessellate.h"
#include "pipeline/rbvh/build.h"
#include "rbvh/camera.h"
#include "tests/proxy_shapes.h"
#include "tests/shapes.h"
#include "tests/trace_test.h"

namespace rbvh {
namespace {

class TraceScene : public TraceTest {
 protected:
  Device device = Device::open();

  std::vector<Hit> cast_counted(const SceneTracer& tracer, const std::vector<Ray>& rays,
                                RayQuery query = RayQuery::kNearest) {
    std::vector<std::uint32_t> visited;
    const std::vector<Hit> found = cast(tracer, rays, query, &visited);
    for (std::size_t i = 0; i < rays.size() && !HasFailure(); ++i) {
      if (is_hit(found[i])) {
        EXPECT_GT(visited[i], 0u);
      }
    }
    return found;
  }

  /// Rays hit the scene where they hit `mesh`, all but those of which rounding decides: at silhouettes,
  /// edges, tmin and tmax. `is_same`: of two hits of one ray. More than `least` hit.
  void expect_like_mesh(const Scene& scene, const Scan& mesh, const std::vector<Ray>& rays, std::size_t least,
                        const std::function<bool(const Hit& hit, const Hit& expected)>& is_same) {
    const std::vector<Hit> expected = cast(make_exact_tracer(device, mesh), rays);
    const SceneTracer tracer = make_scene_tracer(device, scene);
    const std::vector<Hit> hits = cast_counted(tracer, rays),
                           any = cast_counted(tracer, rays, RayQuery::kAny);
    std::size_t found = 0, differing = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      found += is_hit(expected[i]);
      EXPECT_EQ(is_hit(any[i]), is_hit(hits[i])) << "ray " << i;
      differing +=
          is_hit(hits[i]) != is_hit(expected[i]) || (is_hit(hits[i]) && !is_same(hits[i], expected[i]));
    }
    EXPECT_GT(found, least);
    EXPECT_LE(differing, found / 100 + 2);
  }
};

SceneObject object(decltype(SceneObject::content) content, Bounds3f box) {
  SceneObject made;
  made.content = std::move(content);
  made.bounds = box;
  return made;
}

Affine random_transform(Random& random, bool mirrored) {
  Affine a;
  do {
    for (double& x : a.m) x = static_cast<double>(uniform(random, -1, 1));
  } while (std::abs(a.determinant()) < 0.2 || (a.determinant() < 0) != mirrored);
  for (const std::size_t offset : {3u, 7u, 11u}) a.m[offset] *= 3;
  return a;
}

void add_moved(Scan& all, std::vector<std::uint32_t>& leaves, const Scan& one, const SceneInstance& instance,
               std::uint32_t first_leaf, const std::vector<std::uint32_t>* patches) {
  const auto first = static_cast<std::uint32_t>(all.positions.size());
  for (const Vec3f& p : one.positions)
    all.positions.push_back(static_cast<Vec3f>(instance.to_world.point(static_cast<Vec3d>(p))));
  const bool mirrored = instance.to_world.determinant() < 0;
  for (std::size_t t = 0; t < one.triangles.size(); ++t) {
    Triangle triangle = one.triangles[t];
    if (mirrored) std::swap(triangle[1], triangle[2]);  // the outside stays the outside
    for (std::uint32_t& corner : triangle) corner += first;
    all.triangles.push_back(triangle);
    leaves.push_back(first_leaf + (patches != nullptr ? (*patches)[t] : static_cast<std::uint32_t>(t)));
  }
}

TEST_F(TraceScene, IsTheMeshOfAllItsInstances) {
  const std::vector<std::uint32_t> level = {3};
  const Scan ball = globe(random, 8, 12), tiles = grid(4, 0);
  const Proxy proxy = displaced(quad_sphere(2), level, [](Vec3f p) { return mushrooms(p, 0.15f); });
  std::vector<std::uint32_t> patches;
  const Scan reference = tessellate(proxy, 3, &patches);
  Scene scene;
  scene.objects = {object(ball, bounds(ball)), object(proxy, bounds(reference)),
                   object(tiles, bounds(tiles))};
  for (int i = 0; i < 12; ++i)
    scene.instances.push_back({static_cast<std::uint32_t>(i % 3), random_transform(random, i % 2 == 0)});
  const std::vector<std::uint32_t> first = first_leaves(scene);
  EXPECT_EQ(first.back(), 4 * (ball.triangles.size() + proxy.quads.size() + tiles.triangles.size()));
  Scan all;
  std::vector<std::uint32_t> leaves;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Scan* const meshes[] = {&ball, &reference, &tiles};
    add_moved(all, leaves, *meshes[i % 3], scene.instances[i], first[i], i % 3 == 1 ? &patches : nullptr);
  }
  const std::vector<Ray> rays = random_rays(random, all, 4000);
  expect_like_mesh(scene, all, rays, 300, [&](const Hit& hit, const Hit& expected) {
    return hit.leaf == leaves[expected.leaf] &&
           (hit.flags & RBVH_HIT_BACK_FACE) == (expected.flags & RBVH_HIT_BACK_FACE) &&
           std::abs(hit.t - expected.t) <= 1e-4f * std::abs(expected.t) + 1e-5f &&
           dot(normal_of(hit), normal_of(expected)) > 0.999f;
  });
}

// A ray passes hundreds of boxes, a few in each round.
TEST_F(TraceScene, ManyInstancesAreAllThere) {
  Scan kinds[2] = {grid(1, 0), globe(random, 3, 4)};
  Scene scene;
  for (Scan& kind : kinds) scene.objects.push_back(object(kind, bounds(kind)));
  Scan all;
  std::vector<std::uint32_t> leaves;
  for (int i = 0; i < 3000; ++i) {
    Affine a = random_transform(random, i % 2 == 0);
    for (double& x : a.m) x *= 0.05;
    for (const std::size_t offset : {3u, 7u, 11u}) a.m[offset] = static_cast<double>(uniform(random, -1, 1));
    scene.instances.push_back({static_cast<std::uint32_t>(i % 2), a});
    add_moved(all, leaves, kinds[i % 2], scene.instances.back(), static_cast<std::uint32_t>(leaves.size()),
              nullptr);
  }
  const std::vector<Ray> rays = random_rays(random, all, 1000);
  expect_like_mesh(scene, all, rays, 200, [&](const Hit& hit, const Hit& expected) {
    return hit.leaf == leaves[expected.leaf] ||
           std::abs(hit.t - expected.t) <= 1e-4f * std::abs(expected.t) + 1e-5f;
  });
}

TEST_F(TraceScene, ALevelOfAPairIsWhereItIsPlaced) {
  const Scan ball = bumpy_sphere(64);
  const Rbvh pair = build_rbvh(device, ball, BuildConfig{.levels = {{"Q", 3e4f, 0.8f, 60}}});
  Scene scene;
  scene.objects = {object(pair.levels[0], pair.source.bounds)};
  Affine to_world;
  to_world.m = {0, -2, 0, 5, 2, 0, 0, -1, 0, 0, 2, 3};
  scene.instances = {{0, {}}, {0, to_world}};
  const SceneTracer tracer = make_scene_tracer(device, scene);
  std::vector<Ray> rays, moved;
  for (int i = 0; i < 500; ++i) {
    const Vec3f o = uniform_direction(random) * 1.8f, d = uniform_point(random, 0.8f) - o;
    rays.push_back(make_ray(o, d, 0, 1.2f));
    const Vec3d world = to_world.point(static_cast<Vec3d>(o)),
                direction = to_world.vector(static_cast<Vec3d>(d));
    moved.push_back(make_ray(static_cast<Vec3f>(world), static_cast<Vec3f>(direction), 0, 1.2f));
  }
  const std::vector<Hit> a = cast_counted(tracer, rays), b = cast_counted(tracer, moved);
  const auto leaves = static_cast<std::uint32_t>(pair.levels[0].leaves.size());
  std::size_t found = 0, differing = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (a[i].leaf == RBVH_NO_LEAF) continue;
    ++found;
    EXPECT_LT(a[i].leaf, leaves);
    differing += b[i].leaf != a[i].leaf + leaves || std::abs(a[i].t - b[i].t) > 1e-4f;
  }
  EXPECT_GT(found, 200u);
  EXPECT_LE(differing, found / 50);
  const SurfaceSamples samples = tracer.surface(b, 0);
  for (std::size_t i = 0; i < b.size(); ++i) {
    if (b[i].leaf == RBVH_NO_LEAF) continue;
    const Vec3f n = {b[i].normal[0], b[i].normal[1], b[i].normal[2]};
    EXPECT_GT(dot(samples.normals[i], n), 0.5f) << i;
  }
}

}  // namespace
}  // namespace rbvh
