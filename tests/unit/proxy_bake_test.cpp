// Proxies baked from meshes: whole, without cracks, the same every time, whatever the mesh is like.
#include "pipeline/measure/surface_distance.h"
#include "pipeline/proxy/bake.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/proxy/check_proxy.h"
#include "pipeline/proxy/decimate.h"
#include "pipeline/proxy/pair_triangles.h"
#include "pipeline/proxy/patch_point.h"
#include "pipeline/proxy/proxy_surface.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

// A mushroom with a stem, closed, a solid of revolution about z: its cap overhangs and curls in again below,
// so that straight lines cross it up to six times.
Scan mushroom(int n) {
  static constexpr float kProfile[][2] = {{0.f, 0.f},     {0.35f, 0.f},   {0.3f, 0.1f},  {0.15f, 0.3f},
                                          {0.13f, 0.55f}, {0.3f, 0.62f},  {0.45f, 0.5f}, {0.4f, 0.36f},
                                          {0.32f, 0.4f},  {0.3f, 0.3f},   {0.5f, 0.22f}, {0.68f, 0.4f},
                                          {0.6f, 0.7f},   {0.35f, 0.95f}, {0.f, 1.f}};
  constexpr int kLast = static_cast<int>(std::size(kProfile)) - 1;
  Scan scan;
  add_sheet(scan, n, [&](float s, float t) {
    const float along = t * static_cast<float>(kLast);
    const int i = std::min(static_cast<int>(along), kLast - 1);
    const float x = along - static_cast<float>(i), angle = 6.2831853f * s;
    const float r = kProfile[i][0] * (1 - x) + kProfile[i + 1][0] * x;
    const float z = kProfile[i][1] * (1 - x) + kProfile[i + 1][1] * x;
    // The seam's and the poles' vertices come out equal, and are joined.
    return s == 1 ? Vec3f{r, 0, z} : Vec3f{r * std::cos(angle), r * std::sin(angle), z};
  });
  return scan;
}

BakeConfig small_bake(std::uint64_t patches) {
  BakeConfig config;
  config.max_patches = patches;
  return config;
}

struct Distance {
  double to_scan_rms, to_scan_max, to_proxy_rms, to_proxy_max;  ///< as fractions of the diagonal
};
Distance distance(const Proxy& proxy, const Scan& scan) {
  const TriangleSoup a = surface_of(proxy), b = surface_of(scan);
  const DistanceStatistics there = sampled_distance(a, ClosestPoint(b), 20'000),
                           back = sampled_distance(b, ClosestPoint(a), 20'000);
  const double diagonal = bounds(scan).diagonal();
  return {there.rms / diagonal, there.max / diagonal, back.rms / diagonal, back.max / diagonal};
}

double area(const TriangleSoup& soup) {
  double sum = 0;
  for (std::size_t i = 0; i < soup.size(); i += 3)
    sum += length(cross(Vec3d(soup[i + 1] - soup[i]), Vec3d(soup[i + 2] - soup[i]))) / 2;
  return sum;
}

// How many quads each edge of the base has.
std::map<std::size_t, std::size_t> edge_uses(const Proxy& proxy) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> uses;
  for (const Quad& quad : proxy.quads)
    for (std::size_t k = 0; k < 4; ++k) ++uses[std::minmax(quad[k], quad[(k + 1) % 4])];
  std::map<std::size_t, std::size_t> histogram;
  for (const auto& [edge, count] : uses) ++histogram[count];
  return histogram;
}

// Independent of find_fault(): patches at one edge agree bit by bit at the coarser one's texels.
void expect_no_crack(const Proxy& proxy) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::vector<Vec3f>>> lines;
  for (std::size_t patch = 0; patch < proxy.quads.size(); ++patch) {
    const std::uint32_t last = proxy.tiles[patch].side - 1;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint32_t a = proxy.quads[patch][k], b = proxy.quads[patch][(k + 1) % 4];
      std::vector<Vec3f> line;
      for (std::uint32_t n = 0; n <= last; ++n) {
        const std::uint32_t m = a < b ? n : last - n;
        const std::uint32_t i = k == 0 ? m : k == 1 ? last : k == 2 ? last - m : 0;
        const std::uint32_t j = k == 0 ? 0 : k == 1 ? m : k == 2 ? last : last - m;
        line.push_back(surface_point(proxy, patch, i, j));
      }
      lines[std::minmax(a, b)].push_back(line);
    }
  }
  for (const auto& [edge, sides] : lines)
    for (std::size_t s = 1; s < sides.size(); ++s) {
      const auto& coarse = sides[0].size() < sides[s].size() ? sides[0] : sides[s];
      const auto& fine = sides[0].size() < sides[s].size() ? sides[s] : sides[0];
      const std::size_t ratio = (fine.size() - 1) / (coarse.size() - 1);
      for (std::size_t n = 0; n < coarse.size(); ++n) EXPECT_EQ(coarse[n], fine[n * ratio]);
      for (std::size_t n = 0; n < fine.size(); ++n) {
        const std::size_t at = std::min(n / ratio, coarse.size() - 2);
        const float x = static_cast<float>(n - at * ratio) / static_cast<float>(ratio);
        EXPECT_LT(length(mix(coarse[at], coarse[at + 1], x) - fine[n]), 1e-6f);
      }
    }
}

TEST(ProxyBake, UndercutShapeComesBackWhole) {
  const Scan scan = mushroom(120);
  BakeReport counts;
  const Proxy proxy = bake_proxy(scan, "mushroom", small_bake(150), counts);
  EXPECT_LE(proxy.quads.size(), 150u);
  EXPECT_EQ(find_fault(proxy), std::nullopt);
  const Distance d = distance(proxy, scan);
  EXPECT_LT(d.to_scan_rms, 1e-4);
  EXPECT_LT(d.to_proxy_rms, 1e-4);
  EXPECT_LT(d.to_scan_max, 3e-3);
  EXPECT_LT(d.to_proxy_max, 3e-3);
  EXPECT_NEAR(area(surface_of(proxy)) / area(surface_of(scan)), 1, 2e-3);
  EXPECT_EQ(edge_uses(proxy), (std::map<std::size_t, std::size_t>{{2, 2 * proxy.quads.size()}}));  // closed
  EXPECT_EQ(counts.projected_texels, 0u);
}

TEST(ProxyBake, PatchesDoNotCrack) {
  BakeReport counts;
  const Proxy proxy = bake_proxy(bumpy_sphere(100, 0.1f), "sphere", small_bake(60), counts);
  std::set<std::uint32_t> sides;
  for (const PatchTile& tile : proxy.tiles) sides.insert(tile.side);
  EXPECT_GT(sides.size(), 1u);
  expect_no_crack(proxy);
}

TEST(ProxyBake, IsTheSameWithAnyNumberOfThreads) {
  const Scan scan = bumpy_sphere(60);
  BakeReport counts;
  const Proxy a = bake_proxy(scan, "sphere", small_bake(40), counts);
  set_thread_count(1);
  const Proxy b = bake_proxy(scan, "sphere", small_bake(40), counts);
  set_thread_count(0);
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.quads, b.quads);
  EXPECT_EQ(a.map, b.map);
}

TEST(ProxyBake, DetailAndSideSetTheTexels) {
  const Scan scan = bumpy_sphere(100, 0.1f);
  BakeConfig config = small_bake(60);
  BakeReport normal, coarse, short_sides;
  const Proxy proxy = bake_proxy(scan, "sphere", config, normal);
  config.detail *= 16;
  static_cast<void>(bake_proxy(scan, "sphere", config, coarse));
  EXPECT_LT(coarse.texels * 3, normal.texels * 2);
  config.detail /= 16;
  config.max_side = 5;
  const Proxy limited = bake_proxy(scan, "sphere", config, short_sides);
  for (const PatchTile& tile : limited.tiles) EXPECT_LE(tile.side, 5u);
  EXPECT_GT(short_sides.patches_at_limit, 0u);
  EXPECT_LT(distance(proxy, scan).to_scan_rms, distance(limited, scan).to_scan_rms);
}

TEST(ProxyBake, AnErrorBoundInPlaceOfANumber) {
  const Scan scan = bumpy_sphere(60);
  BakeConfig config = small_bake(0);
  config.max_error = 0.03;
  BakeReport few, many;
  static_cast<void>(bake_proxy(scan, "sphere", config, few));
  config.max_error = 0.003;
  static_cast<void>(bake_proxy(scan, "sphere", config, many));
  EXPECT_GT(few.patches, 3u);
  EXPECT_LT(few.patches * 2, many.patches);
  EXPECT_LT(many.patches, scan.triangles.size() / 4);
}

TEST(ProxyBake, OpenSheetKeepsItsBoundary) {
  Scan scan;
  add_sheet(scan, 50, [](float s, float t) { return Vec3f{s, t, 0.1f * std::sin(9 * s) * std::sin(7 * t)}; });
  BakeReport counts;
  const Proxy proxy = bake_proxy(scan, "sheet", small_bake(20), counts);
  EXPECT_EQ(find_fault(proxy), std::nullopt);
  EXPECT_EQ(counts.mesh.open_edges, 200u);
  const Distance d = distance(proxy, scan);
  EXPECT_LT(d.to_scan_rms, 3e-4);
  EXPECT_LT(d.to_proxy_max, 5e-3);
  const Bounds3f box = surface_bounds(proxy);
  EXPECT_NEAR(box.lo.x, 0, 1e-4);
  EXPECT_NEAR(box.hi.y, 1, 1e-4);
}

TEST(ProxyBake, TinyMeshes) {
  for (const std::size_t triangles : {1u, 2u, 3u, 4u}) {
    Scan scan;
    scan.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    scan.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
    scan.triangles.resize(triangles);
    BakeReport counts;
    const Proxy proxy = bake_proxy(scan, "tiny", small_bake(10), counts);
    EXPECT_EQ(find_fault(proxy), std::nullopt);
    EXPECT_EQ(proxy.quads.size(), (triangles + 1) / 2);
    EXPECT_LT(distance(proxy, scan).to_proxy_max, 1e-6) << triangles;
  }
}

TEST(ProxyBake, MeshesThatAreNoSurface) {
  // Three sheets at one edge; a triangle of the wrong orientation; a vertex of two fans; a triangle
  // twice, front and back.
  Scan scan = bumpy_sphere(20);
  const std::uint32_t a = scan.triangles[100][0], b = scan.triangles[100][1];
  scan.positions.push_back({3, 0, 0});
  scan.positions.push_back({3, 1, 0});
  const auto last = static_cast<std::uint32_t>(scan.positions.size()) - 1;
  scan.triangles.push_back({a, b, last});
  scan.triangles.push_back({scan.triangles[300][0], last - 1, last});
  std::swap(scan.triangles[200][0], scan.triangles[200][1]);
  scan.triangles.push_back({scan.triangles[50][1], scan.triangles[50][0], scan.triangles[50][2]});
  scan.triangles.push_back({a, a, b});
  BakeConfig config = small_bake(200);
  config.min_component = 0;
  BakeReport counts;
  const Proxy proxy = bake_proxy(scan, "odd", config, counts);
  EXPECT_EQ(find_fault(proxy), std::nullopt);
  EXPECT_GT(counts.mesh.cut_edges, 3u);
  EXPECT_GT(counts.mesh.cut_vertices, 0u);
  EXPECT_GE(counts.mesh.flat_triangles, 1u);
  EXPECT_LT(distance(proxy, scan).to_proxy_max, 2e-2);
}

TEST(ProxyBake, SoupIsTakenAsItIs) {
  Scan scan;
  std::uint32_t state = 1;
  const auto next = [&] {
    return static_cast<float>((state = state * 1664525u + 1013904223u) >> 8) / 16777216.f;
  };
  for (std::uint32_t i = 0; i < 30; ++i) scan.positions.push_back({next(), next(), next()});
  for (std::uint32_t i = 0; i < 300; ++i)
    scan.triangles.push_back({static_cast<std::uint32_t>(next() * 30),
                              static_cast<std::uint32_t>(next() * 30),
                              static_cast<std::uint32_t>(next() * 30)});
  BakeConfig config = small_bake(400);
  config.min_component = 0;
  BakeReport counts;
  EXPECT_EQ(find_fault(bake_proxy(scan, "soup", config, counts)), std::nullopt);
}

TEST(ProxyBake, SmallPartsGoAndAreCounted) {
  Scan scan = bumpy_sphere(40);
  for (int i = 0; i < 5; ++i) {
    const auto first = static_cast<std::uint32_t>(scan.positions.size());
    const float x = 2 + static_cast<float>(i);
    scan.positions.insert(scan.positions.end(), {{x, 0, 0}, {x + 0.01f, 0, 0}, {x, 0.01f, 0}});
    scan.triangles.push_back({first, first + 1, first + 2});
  }
  BakeReport counts;
  BakeConfig config = small_bake(50);
  static_cast<void>(bake_proxy(scan, "parts", config, counts));
  EXPECT_EQ(counts.mesh.small_components, 5u);
  EXPECT_EQ(counts.mesh.components, 1u);
  config.min_component = 0;
  static_cast<void>(bake_proxy(scan, "parts", config, counts));
  EXPECT_EQ(counts.mesh.small_components, 0u);
  EXPECT_EQ(counts.mesh.components, 6u);
}

std::optional<ErrorKind> error_of(const Scan& scan, const BakeConfig& config) {
  BakeReport counts;
  try {
    static_cast<void>(bake_proxy(scan, "bad", config, counts));
  } catch (const Error& error) {
    return error.kind();
  }
  return std::nullopt;
}

TEST(ProxyBake, WhatCannotBeBaked) {
  Scan cloud;
  cloud.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  EXPECT_EQ(error_of(cloud, {}), ErrorKind::kInput);
  cloud.triangles = {{0, 0, 1}};
  EXPECT_EQ(error_of(cloud, {}), ErrorKind::kInput);
  EXPECT_EQ(error_of(bumpy_sphere(20), small_bake(1)), ErrorKind::kBudget);
}

// Every triangle of the original has points of the base, and neighbours on the base stay neighbours.
TEST(SelfMap, IsOntoAndContinuous) {
  const Scan scan = mushroom(24);
  ManifoldCounts counts;
  const Manifold mesh = make_manifold(scan, 0, counts);
  Decimation decimation(mesh, "mushroom");
  decimation.run(24, 1e30, {});
  const BaseMesh base = decimation.base();
  const SelfMap map = decimation.finish();
  ASSERT_LE(base.triangles.size(), 24u);
  std::vector<bool> is_hit(mesh.triangles.size());
  constexpr int kSteps = 400;
  double longest = 0;
  for (std::size_t t = 0; t < base.triangles.size(); ++t)
    for (int i = 0; i <= kSteps; ++i) {
      Vec3d before{};
      for (int j = 0; j <= kSteps - i; ++j) {
        const double u = static_cast<double>(i) / kSteps, v = static_cast<double>(j) / kSteps;
        const FacePoint p = map.to_original({base.versions[t], {1 - u - v, u, v}});
        ASSERT_LT(p.version, mesh.triangles.size());
        is_hit[p.version] = true;
        Vec3d point{};
        for (std::size_t k = 0; k < 3; ++k) {
          ASSERT_GE(p.weights[k], 0);
          point = point + Vec3d(mesh.positions[mesh.triangles[p.version][k]]) * p.weights[k];
        }
        if (j > 0) longest = std::max(longest, length(point - before));
        before = point;
      }
    }
  EXPECT_EQ(std::count(is_hit.begin(), is_hit.end(), false), 0);
  EXPECT_LT(longest, 0.1);  // a jump would be as long as the sphere is wide
}

TEST(PairTriangles, LeavesNoneAloneOnAClosedSurface) {
  for (const std::uint64_t triangles : {4u, 40u, 301u}) {
    ManifoldCounts counts;
    const Manifold mesh = make_manifold(mushroom(20), 0, counts);
    Decimation decimation(mesh, "mushroom");
    decimation.run(triangles, 1e30, {});
    std::uint64_t alone = 0;
    const std::vector<TrianglePair> pairs = pair_triangles(decimation.base(), alone);
    EXPECT_EQ(alone, 0u);
    EXPECT_EQ(2 * pairs.size(), decimation.triangle_count());
  }
}

}  // namespace
}  // namespace rbvh
