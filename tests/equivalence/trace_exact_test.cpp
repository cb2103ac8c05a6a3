// The equivalence matrix: every exact traversal on every builder's tree, each found by itself in
// exact_methods.h, against brute force in double precision, ray by ray: nearest and any hit, triangles and
// discs, and the cases that break ray tracers. Nearest hits must be the same for all, to the last bit.
//
// A disagreement with brute force is an error unless float rounding explains it. Ties, a hit within 1e-6
// (barycentric) of an edge or two nearest t within 4 ulp, are counted; beyond them each primitive's error
// bound follows from the coordinates' size, its own size and how edge-on the ray sees it, and those are
// counted, too.
#include "pipeline/trace/trace_exact.h"

#include <gtest/gtest.h>

#include <cstring>
#include <iomanip>
#include <optional>

#include "pipeline/device/device.h"
#include "pipeline/trace/camera_rays.h"
#include "rbvh/camera.h"
#include "tests/oracle_bounds.h"
#include "tests/trace_test.h"

namespace rbvh {
namespace {

/// A traversal on a builder's tree.
struct Method {
  std::string name;
  ExactTracer tracer;
};

/// All that can take the scan.
std::vector<Method> all_methods(const Device& device, const Scan& scan) {
  std::vector<Method> methods;
  const bool discs = scan.is_cloud() && !scan.positions.empty();
  for (const ExactTraversalInfo& t : kExactTraversals) {
    for (const ExactBuilderInfo& b : kExactBuilders) {
      if (b.tree != t.tree || (discs && !t.discs)) continue;
      methods.push_back(
          {std::string(t.name) + " on " + b.name, make_exact_tracer(device, scan, {t.traversal, b.builder})});
    }
  }
  return methods;
}

/// t, place and flags to the last bit; normals are computed afterwards, to within rounding.
bool is_same(const Hit& a, const Hit& b) {
  return a.t == b.t && a.u == b.u && a.v == b.v && a.leaf == b.leaf && a.flags == b.flags &&
         std::abs(a.normal[0] - b.normal[0]) < 1e-6f && std::abs(a.normal[1] - b.normal[1]) < 1e-6f &&
         std::abs(a.normal[2] - b.normal[2]) < 1e-6f;
}

/// Nearest hits, the same ones by all methods.
std::vector<Hit> cast_all(const std::vector<Method>& methods, const std::vector<Ray>& rays) {
  const std::vector<Hit> hits = cast(methods[0].tracer, rays, RayQuery::kNearest);
  for (const Method& method : methods) {
    const std::vector<Hit> others = cast(method.tracer, rays, RayQuery::kNearest);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Hit &a = hits[i], &b = others[i];
      EXPECT_TRUE(is_same(a, b)) << method.name << " differs from " << methods[0].name << " at ray " << i
                                 << std::setprecision(9) << ": t " << b.t << " u " << b.u << " v " << b.v
                                 << " leaf " << b.leaf << ", not " << a.t << ", " << a.u << ", " << a.v
                                 << ", " << a.leaf;
      if (!is_same(a, b)) break;
    }
  }
  return hits;
}

/// Over all comparisons: rays whose hit is not brute force's, by what explains it.
struct Ties {
  std::size_t rays = 0, ties = 0, rounding = 0;
};

/// Compares every ray; returns how many were beyond doubt (a hit well inside, or nothing anywhere near).
std::size_t compare(const Scan& scan, const std::vector<Ray>& rays, const std::vector<Hit>& hits,
                    RayQuery query, Ties* ties = nullptr) {
  const std::size_t count = scan.is_cloud() ? scan.positions.size() : scan.triangles.size();
  std::size_t beyond_doubt = 0;
  for (std::size_t r = 0; r < rays.size(); ++r) {
    const Ray& ray = rays[r];
    const Hit& hit = hits[r];
    bool doubt = false;
    double nearest_sure = kInfinity, nearest = kInfinity, second = kInfinity, nearest_inside = 1;
    double exact_t = kInfinity;
    std::uint32_t exact_leaf = RBVH_NO_LEAF;  // in double precision, whatever its error
    std::optional<Bounded> claimed;
    for (std::size_t i = 0; i < count; ++i) {
      const std::optional<Bounded> b = meet(scan, i, ray);
      if (!b) continue;
      const double inside = b->meeting.inside, t = b->meeting.t;
      const bool possible =
          inside > -b->inside_error && t >= ray.tmin - b->t_error && t <= ray.tmax + b->t_error;
      const bool sure = inside > b->inside_error && t >= ray.tmin + b->t_error && t <= ray.tmax - b->t_error;
      if (sure) nearest_sure = std::min(nearest_sure, t + b->t_error);
      doubt = doubt || (possible && !sure);
      if (possible) {
        second = std::min(second, std::max(t, nearest));
        if (t < nearest) nearest_inside = std::abs(inside);
        nearest = std::min(nearest, t);
      }
      if (possible && i == hit.leaf) claimed = b;
      if (inside >= 0 && t >= ray.tmin && t <= ray.tmax && t < exact_t) {
        exact_t = t;
        exact_leaf = static_cast<std::uint32_t>(i);
      }
    }
    const auto where = [&] {
      return ::testing::Message() << "ray " << r << " o " << ray.origin[0] << ' ' << ray.origin[1] << ' '
                                  << ray.origin[2] << " d " << ray.direction[0] << ' ' << ray.direction[1]
                                  << ' ' << ray.direction[2] << " [" << ray.tmin << ", " << ray.tmax
                                  << "] hit t " << hit.t << " leaf " << hit.leaf << ", surely one at "
                                  << nearest_sure;
    };
    if (hit.leaf == RBVH_NO_LEAF) {
      EXPECT_EQ(hit.t, kInfinity);
      EXPECT_EQ(hit.flags, 0u);
      EXPECT_EQ(nearest_sure, kInfinity) << where() << ": missed";
    } else {
      EXPECT_TRUE(claimed.has_value()) << where() << ": nothing is there";
      if (!claimed) continue;
      const oracle::Meeting& m = claimed->meeting;
      EXPECT_NEAR(hit.t, m.t, claimed->t_error) << where();
      EXPECT_GE(hit.t, ray.tmin) << where();
      EXPECT_LE(hit.t, ray.tmax) << where();
      if (query == RayQuery::kNearest) {
        EXPECT_LE(hit.t, nearest_sure + claimed->t_error) << where() << ": not the nearest";
      }
      const double along =
          m.normal[0] * hit.normal[0] + m.normal[1] * hit.normal[1] + m.normal[2] * hit.normal[2];
      EXPECT_GT(along, 0.9999) << where();
      const double slope =
          (m.normal[0] * ray.direction[0] + m.normal[1] * ray.direction[1] + m.normal[2] * ray.direction[2]);
      EXPECT_EQ((hit.flags & RBVH_HIT_BACK_FACE) != 0, slope > 0) << where();
      EXPECT_NE(hit.flags & RBVH_HIT_ON_PRIMITIVE, 0u);
      if (scan.is_cloud()) {
        EXPECT_NEAR(std::hypot(hit.u, hit.v), 1 - m.inside, claimed->inside_error + 1e-5) << where();
      } else {
        EXPECT_NEAR(hit.u, m.u, claimed->inside_error + 1e-6) << where();
        EXPECT_NEAR(hit.v, m.v, claimed->inside_error + 1e-6) << where();
      }
    }
    beyond_doubt += doubt ? 0 : 1;
    if (ties != nullptr) {
      const bool tie = nearest_inside < 1e-6 || second - nearest <= 4 * 1.2e-7 * std::abs(nearest);
      ++ties->rays;
      ties->ties += tie && hit.leaf != exact_leaf ? 1 : 0;
      ties->rounding += !tie && hit.leaf != exact_leaf ? 1 : 0;
    }
    if (::testing::Test::HasFailure()) return 0;  // one ray's message is enough
  }
  return beyond_doubt;
}

class TraceExact : public TraceTest {
 protected:
  Device device = Device::open();

  ~TraceExact() override {
    if (ties.rays > 0) {
      std::printf("%zu rays; not as brute force has it: %zu ties, %zu more within rounding\n", ties.rays,
                  ties.ties, ties.rounding);
    }
  }

  void check(const Scan& scan, const std::vector<Ray>& rays, double least_beyond_doubt) {
    const std::vector<Method> methods = all_methods(device, scan);
    const std::vector<Hit> nearest = cast_all(methods, rays);
    const std::size_t beyond_doubt = compare(scan, rays, nearest, RayQuery::kNearest, &ties);
    if (HasFailure()) return;
    EXPECT_GE(static_cast<double>(beyond_doubt), least_beyond_doubt * static_cast<double>(rays.size()));
    std::vector<std::vector<Hit>> seen;  // any hits that were compared already
    for (const Method& method : methods) {
      SCOPED_TRACE(method.name);
      const std::vector<Hit> any = cast(method.tracer, rays, RayQuery::kAny);
      for (std::size_t i = 0; i < rays.size(); ++i) {
        ASSERT_EQ(any[i].leaf == RBVH_NO_LEAF, nearest[i].leaf == RBVH_NO_LEAF) << "ray " << i;
        ASSERT_GE(any[i].t, nearest[i].t) << "ray " << i;
      }
      const bool known = std::any_of(seen.begin(), seen.end(), [&](const std::vector<Hit>& hits) {
        return rays.empty() || std::memcmp(hits.data(), any.data(), any.size() * sizeof(Hit)) == 0;
      });
      if (known) continue;
      compare(scan, rays, any, RayQuery::kAny);
      if (HasFailure()) return;
      seen.push_back(any);
    }
  }

  Ties ties;
};

TEST_F(TraceExact, RandomSoups) {
  for (const std::size_t count : {0u, 1u, 2u, 7u, 8u, 9u, 100u, 3000u}) {
    SCOPED_TRACE(count);
    const Scan scan = soup(random, count, count > 500 ? 0.1f : 0.5f);
    check(scan, random_rays(random, scan, count > 500 ? 2000 : 600), 0.97);
    check(scan, exact_rays(random, scan, 300), 0);
  }
}

TEST_F(TraceExact, RandomDiscs) {
  for (const std::size_t count : {1u, 2u, 9u, 100u, 3000u}) {
    SCOPED_TRACE(count);
    const Scan scan = discs(random, count, count > 500 ? 0.08f : 0.5f);
    check(scan, random_rays(random, scan, count > 500 ? 2000 : 600), 0.97);
    check(scan, exact_rays(random, scan, 300), 0);
  }
}

TEST_F(TraceExact, FarFromTheOrigin) {
  for (const float offset : {-17.0f, 1000.0f}) {
    Scan scan = soup(random, 500, 0.3f);
    for (Vec3f& p : scan.positions) p = p + Vec3f{offset, -2 * offset, offset};
    check(scan, random_rays(random, scan, 1000), 0.5);
    check(scan, exact_rays(random, scan, 300), 0);
    Scan cloud = discs(random, 500, 0.2f);
    for (Vec3f& p : cloud.positions) p = p + Vec3f{offset, offset, offset};
    check(cloud, random_rays(random, cloud, 1000), 0.5);
  }
}

TEST_F(TraceExact, FlatGridAlongAcrossAndOnItsLines) {
  for (const float height : {0.0f, 3.0f}) {
    const Scan scan = grid(16, height);
    check(scan, exact_rays(random, scan, 1000), 0);
    check(scan, random_rays(random, scan, 1000), 0.8);
    // Straight through every vertex and every midpoint of an edge: never a gap.
    std::vector<Ray> rays;
    for (int y = 0; y <= 32; ++y) {
      for (int x = 0; x <= 32; ++x) {
        const Vec3f o = {0.5f * static_cast<float>(x), 0.5f * static_cast<float>(y), height + 5};
        rays.push_back(make_ray(o, {0, 0, -1}));
        rays.push_back(make_ray(o, {-0.0f, -0.0f, -2}));
      }
    }
    const std::vector<Hit> hits = cast_all(all_methods(device, scan), rays);
    for (std::size_t i = 0; i < hits.size(); ++i) {
      ASSERT_EQ(hits[i].t, i % 2 ? 2.5f : 5.0f) << i;
      ASSERT_NE(hits[i].leaf, RBVH_NO_LEAF) << i;
    }
  }
}

TEST_F(TraceExact, AClosedMeshHasNoGapAtVerticesAndEdges) {
  const Scan scan = globe(random, 24, 48);
  const std::vector<Method> methods = all_methods(device, scan);
  std::vector<Ray> rays;
  for (const Vec3f& origin : {Vec3f{0, 0, 0}, Vec3f{0.5f, 0.25f, -0.125f}, uniform_point(random, 0.4f)}) {
    for (const Vec3f& p : scan.positions) rays.push_back(make_ray(origin, p - origin));
    for (const Triangle& t : scan.triangles) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec3f &a = scan.positions[t[k]], &b = scan.positions[t[(k + 1) % 3]];
        for (const float s : {0.5f, uniform(random, 0, 1)})
          rays.push_back(make_ray(origin, a + (b - a) * s - origin));
      }
    }
    for (int axis = 0; axis < 3; ++axis) {
      Vec3f d{};
      d[axis] = 1;
      rays.push_back(make_ray(origin, d));
      rays.push_back(make_ray(origin, -d));
    }
  }
  const std::vector<Hit> hits = cast_all(methods, rays);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    ASSERT_NE(hits[i].leaf, RBVH_NO_LEAF) << "ray " << i << " leaves a closed mesh";
  }
}

TEST_F(TraceExact, OfDuplicatesTheFirstIsHit) {
  Scan scan = soup(random, 1, 1);
  const Scan one = scan;
  for (int i = 0; i < 300; ++i) scan.triangles.push_back(one.triangles[0]);
  std::vector<Ray> rays = random_rays(random, scan, 500);
  check(scan, rays, 0.9);
  for (const Hit& hit : cast_all(all_methods(device, scan), rays)) {
    EXPECT_TRUE(hit.leaf == 0 || hit.leaf == RBVH_NO_LEAF) << hit.leaf;
  }
}

TEST_F(TraceExact, PrimitivesThatAreNotThereAreNeverHit) {
  Scan scan = soup(random, 40, 0.5f);
  scan.positions[3].y = kNan;
  scan.positions[7].x = kInfinity;
  scan.positions[9].z = -kInfinity;
  scan.positions[13] = scan.positions[12];  // a line
  scan.positions[17] =
      scan.positions[15] + (scan.positions[16] - scan.positions[15]) * 2.0f;  // a line in space
  scan.positions[18] = scan.positions[19] = scan.positions[20];               // a point
  check(scan, random_rays(random, scan, 1000), 0.9);
  for (const Hit& hit : cast_all(all_methods(device, scan), exact_rays(random, scan, 1000))) {
    for (const std::uint32_t id : {1u, 2u, 3u, 4u, 6u}) EXPECT_NE(hit.leaf, id);
  }
  Scan cloud = discs(random, 40, 0.5f);
  cloud.positions[1].x = kNan;
  cloud.normals[2] = {};
  cloud.normals[3].z = kNan;
  cloud.radii[4] = 0;
  cloud.radii[5] = -1;
  cloud.radii[6] = kNan;
  cloud.radii[7] = kInfinity;
  for (const Hit& hit :
       cast(make_exact_tracer(device, cloud), random_rays(random, cloud, 3000), RayQuery::kNearest)) {
    EXPECT_TRUE(hit.leaf == RBVH_NO_LEAF || hit.leaf == 0 || hit.leaf > 7) << hit.leaf;
  }
}

TEST_F(TraceExact, NothingButBadPrimitivesIsAnEmptyScene) {
  Scan scan;
  add_triangle(scan, {0, 0, 0}, {1, 1, 1}, {2, 2, 2});
  add_triangle(scan, {kNan, 0, 0}, {1, 0, 0}, {0, 1, 0});
  for (const Hit& hit : cast_all(all_methods(device, scan), random_rays(random, soup(random, 1, 1), 100))) {
    EXPECT_EQ(hit.leaf, RBVH_NO_LEAF);
  }
}

TEST_F(TraceExact, BadRaysHitNothing) {
  Scan scan;
  add_triangle(scan, {-1, -1, 0}, {1, -1, 0}, {0, 1, 0});
  const Vec3f o = {0, 0, 1}, d = {0, 0, -1};
  const std::vector<Ray> rays = {make_ray({kNan, 0, 1}, d), make_ray(o, {0, kNan, -1}),
                                 make_ray(o, {0, 0, 0}),    make_ray(o, {0, 0, -kInfinity}),
                                 make_ray(o, d, kNan),      make_ray(o, d, 0, kNan),
                                 make_ray(o, d, 2, 1),      make_ray(o, d, 0, 0.5f),
                                 make_ray(o, d, 1.5f)};
  for (const Method& method : all_methods(device, scan)) {
    SCOPED_TRACE(method.name);
    for (const RayQuery query : {RayQuery::kNearest, RayQuery::kAny}) {
      const std::vector<Hit> hits = cast(method.tracer, rays, query);
      for (std::size_t i = 0; i < rays.size(); ++i) {
        EXPECT_EQ(hits[i].leaf, RBVH_NO_LEAF) << i;
        EXPECT_EQ(hits[i].t, kInfinity) << i;
      }
      // The interval's ends belong to it.
      EXPECT_EQ(cast(method.tracer, {make_ray(o, d, 1, 1)}, query)[0].t, 1.0f);
      EXPECT_EQ(cast(method.tracer, {make_ray({0, 0, -1}, d, -1, 1)}, query)[0].t, -1.0f);
    }
  }
}

TEST_F(TraceExact, Slivers) {
  const Scan scan = slivers(random, 500);
  check(scan, random_rays(random, scan, 1000), 0.5);
  check(scan, exact_rays(random, scan, 300), 0);
}

TEST_F(TraceExact, EqualCentres) {
  Scan scan;
  for (int i = 1; i <= 400; ++i) {  // one in another, all around one point
    const Vec3f u = uniform_direction(random) * (0.01f * static_cast<float>(i));
    const Vec3f v = uniform_direction(random) * (0.01f * static_cast<float>(i));
    add_triangle(scan, u, v, -(u + v));
  }
  check(scan, random_rays(random, scan, 1000), 0.5);
}

TEST_F(TraceExact, RaysThatStartOnTheSurface) {
  const Scan scan = globe(random, 12, 24);
  std::vector<Ray> rays;
  for (const Triangle& t : scan.triangles) {
    const Vec3f c = (scan.positions[t[0]] + scan.positions[t[1]] + scan.positions[t[2]]) * (1.0f / 3.0f);
    rays.push_back(make_ray(c, uniform_direction(random), 1e-4f));
    rays.push_back(make_ray(scan.positions[t[0]], uniform_direction(random), 1e-4f));
    rays.push_back(make_ray(c, uniform_direction(random)));
  }
  check(scan, rays, 0);
}

TEST_F(TraceExact, AMillionUnitsAway) {
  Scan scan = soup(random, 300, 40);
  for (Vec3f& p : scan.positions) p = p * 100.0f + Vec3f{1e6f, -1e6f, 1e6f};
  check(scan, random_rays(random, scan, 500), 0);
  check(scan, exact_rays(random, scan, 300), 0);
}

TEST_F(TraceExact, TreesDeeperThanAWordHasBits) {
  // Morton codes of one bit each, which are taken off one at a time, and many of none, told apart by place.
  Scan scan;
  const auto add = [&](const Vec3f& c, float e) {
    add_triangle(scan, c + Vec3f{-e, -e, -e}, c + Vec3f{e, e, 0}, c + Vec3f{-e, e, e});
  };
  for (int bit = -1; bit <= 20; ++bit) {
    for (int axis = 0; axis < 3; ++axis) {
      Vec3f c{};
      c[axis] = std::ldexp(1.0f, bit);
      add(c, 0.25f * c[axis]);
    }
  }
  for (int i = 0; i < 600; ++i) add({0, 0, 0}, 1e-3f * static_cast<float>(1 + i % 7));
  bool deep = false;
  for (const Method& method : all_methods(device, scan)) {
    deep = deep || method.tracer.options.find("TRAIL_WORDS=2") != std::string::npos;
  }
  EXPECT_TRUE(deep);
  std::vector<Ray> rays = random_rays(random, scan, 300);
  for (std::size_t i = 0; i < 100; ++i) {  // at each, from its own size away; and through many
    const Triangle& t = scan.triangles[i];
    const Vec3f a = scan.positions[t[0]], b = scan.positions[t[1]], c = scan.positions[t[2]];
    const Vec3f middle = a * 0.5f + b * 0.3f + c * 0.2f;
    rays.push_back(make_ray(middle + cross(b - a, c - a) * (1 / length(b - a)), middle - a));
    rays.push_back(make_ray(middle - Vec3f{0, 0, length(b - a)}, {0, 0, 1}));
    rays.push_back(make_ray(middle * 2.0f, -middle));
    rays.push_back(make_ray(-middle, middle));
  }
  check(scan, rays, 0);
}

TEST_F(TraceExact, ManyDuplicatesOfOneCode) {
  Scan scan = soup(random, 1, 1);
  const Triangle one = scan.triangles[0];
  scan.triangles.assign(200'000, one);
  Scan alone = scan;
  alone.triangles.resize(1);
  const std::vector<Ray> rays = random_rays(random, scan, 20);
  const std::vector<Hit> expected = cast(make_exact_tracer(device, alone), rays, RayQuery::kNearest);
  for (const ExactTraversalInfo& t : kExactTraversals) {
    for (const ExactBuilderInfo& b : kExactBuilders) {
      if (b.tree != t.tree) continue;
      SCOPED_TRACE(std::string(t.name) + " on " + b.name);
      const std::vector<Hit> hits =
          cast(make_exact_tracer(device, scan, {t.traversal, b.builder}), rays, RayQuery::kNearest);
      for (std::size_t i = 0; i < rays.size(); ++i) ASSERT_EQ(hits[i].leaf, expected[i].leaf) << i;
    }
  }
}

TEST_F(TraceExact, CameraRaysAreThePixelsRays) {
  const Scan scan = soup(random, 300, 0.4f);
  const Bounds3f box = bounds(scan);
  const Camera camera =
      place_camera({}, {static_cast<Vec3d>(box.lo), static_cast<Vec3d>(box.hi)}, {0, 1, 0}, 1.3);
  const CameraRays words = camera_rays(camera, 37, 29);  // not whole squares
  std::vector<Ray> rays;
  for (std::uint32_t y = 0; y < words.height; ++y) {
    for (std::uint32_t x = 0; x < words.width; ++x) {
      rays.push_back(
          make_ray({words.position[0], words.position[1], words.position[2]}, pixel_direction(words, x, y)));
    }
  }
  for (const Method& method : all_methods(device, scan)) {
    SCOPED_TRACE(method.name);
    Buffer<Hit> hits(device, rays.size());
    Buffer<std::uint32_t> steps(device, rays.size());
    hits.fill(0xcd);
    steps.fill(0);
    method.tracer.intersect(words, hits, &steps);
    EXPECT_GT(compare(scan, rays, hits.read(), RayQuery::kNearest), rays.size() * 9 / 10);
    std::uint64_t total = 0;
    for (const std::uint32_t count : steps.read()) total += count;
    EXPECT_GT(total, rays.size());
    if (method.tracer.beam_pixels > 0) {
      // The same hits as one by one, from afar and from amid the triangles.
      ExactTracer alone = method.tracer;
      alone.beam_pixels = 0;
      CameraRays inside = words;
      for (float& position : inside.position) position *= 0.01f;
      Buffer<Hit> others(device, rays.size());
      for (const CameraRays& c : {words, inside}) {
        method.tracer.intersect(c, hits);
        alone.intersect(c, others);
        const std::vector<Hit> a = hits.read(), b = others.read();
        for (std::size_t i = 0; i < a.size(); ++i) EXPECT_TRUE(is_same(a[i], b[i])) << i;
      }
      continue;
    }
    const ExactVisits mean =
        mean_visits(method.tracer, Buffer<Ray>(device, rays), rays.size(), RayQuery::kNearest);
    EXPECT_NEAR(mean.nodes + mean.primitives, static_cast<double>(total) / static_cast<double>(rays.size()),
                0.1);
  }
}

}  // namespace
}  // namespace rbvh
