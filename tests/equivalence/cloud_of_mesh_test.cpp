// Clouds against the mesh that they were sampled from: normals, radii and tiles together must
// reproduce the surface.
#include <gtest/gtest.h>

#include <numbers>

#include "pipeline/device/device.h"
#include "pipeline/measure/fidelity.h"
#include "pipeline/measure/surface_distance.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/level_surface.h"
#include "pipeline/scan/complete_cloud.h"
#include "pipeline/scan/radii.h"
#include "pipeline/trace/trace_exact.h"
#include "pipeline/trace/trace_tile.h"
#include "tests/bench/vary_scan.h"
#include "tests/property.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

constexpr std::size_t kPoints = 12000;
constexpr double kTurn = 2 * std::numbers::pi;

/// A ring of unequal thickness, closed.
Scan torus(int n) {
  Scan scan;
  add_sheet(scan, n, [](float s, float t) {
    const double phi = kTurn * static_cast<double>(s), theta = kTurn * static_cast<double>(t);
    const double thin = 0.35 + 0.1 * std::cos(phi), r = 1 + thin * std::cos(theta);
    return static_cast<Vec3f>(Vec3d{r * std::cos(phi), r * std::sin(phi), thin * std::sin(theta)});
  });
  return scan;
}

struct Found {
  HitFidelity views;
  std::uint64_t holes = 0;  ///< of the pair, where the mesh's 3 x 3 neighbourhood and the exact discs are hit
  std::uint64_t discs_holes = 0;          ///< of the exact discs
  DistanceStatistics to_mesh, from_mesh;  ///< in mean spacings of the points
  double spacing = 0, texel = 0;
};

Found compare(const Scan& mesh, const Scan& cloud) {
  const Device device = Device::open();
  BuildConfig config;
  config.levels = {standard_levels()[0]};
  const Level level = std::move(build_rbvh(device, cloud, config).levels[0]);
  const auto cast = [&](const auto& tracer, const CameraRays& camera) {
    const Buffer<Hit> hits(device, std::size_t{camera.width} * camera.height);
    tracer.intersect(camera, hits);
    return hits.read();
  };
  const ExactTracer exact_mesh = make_exact_tracer(device, mesh),
                    exact_discs = make_exact_tracer(device, cloud);
  const TileTracer pair = make_tile_tracer(device, level);
  Found found;
  const std::vector<CastView> casts = {[&](const CameraRays& c) { return cast(exact_discs, c); },
                                       [&](const CameraRays& c) { return cast(pair, c); }};
  const ViewsConfig views{.views = 4, .resolution = 192};
  std::vector<std::uint8_t> in_discs;
  const std::vector<ViewsFidelity> all =
      measure_views([&](const CameraRays& c) { return cast(exact_mesh, c); }, casts, bounds(mesh), views, {},
                    [&](const MeasuredView& view) {
                      const std::vector<PixelFault> faults = find_faults(
                          view.exact, view.hits, views.resolution, views.resolution, bounds(mesh).diagonal());
                      if (view.level == 0) in_discs.assign(faults.size(), 1);
                      for (std::size_t i = 0; i < faults.size(); ++i) {
                        if (faults[i] != PixelFault::kHole) continue;
                        if (view.level == 0)
                          in_discs[i] = 0, ++found.discs_holes;
                        else
                          found.holes += in_discs[i];
                      }
                    });
  found.views = all[1].all;
  found.spacing = std::sqrt(surface_area(mesh) / static_cast<double>(cloud.positions.size()));
  found.texel = texel_side(level);
  const TriangleSoup mesh_soup = surface_of(mesh), level_soup = surface_of(level);
  found.to_mesh = sampled_distance(level_soup, ClosestPoint(mesh_soup), 10000);
  found.from_mesh = sampled_distance(mesh_soup, ClosestPoint(level_soup), 10000);
  std::printf(
      "spacing %.3g texel %.3g; holes %zu (discs %zu); to mesh rms %.3f max %.3f, from it rms %.3f max %.3f "
      "spacings; normals %.1f %.1f degrees\n",
      found.spacing, found.texel, found.holes, found.discs_holes, found.to_mesh.rms / found.spacing,
      found.to_mesh.max / found.spacing, found.from_mesh.rms / found.spacing,
      found.from_mesh.max / found.spacing, found.views.normal_degrees.median, found.views.normal_degrees.p95);
  return found;
}

TEST(CloudOfMesh, GivesTheSurfaceBack) {
  const Scan mesh = torus(80);
  for (const double noise : {0.0, 0.1}) {
    SCOPED_TRACE(noise);
    Scan cloud = sample_points(mesh, kPoints, property_seed());
    const double spacing = std::sqrt(surface_area(mesh) / static_cast<double>(kPoints));
    add_noise(cloud, noise * spacing, property_seed() + 1);
    cloud.normals.clear();
    complete_cloud(cloud, {});
    const Found found = compare(mesh, cloud);
    EXPECT_LE(found.texel, found.spacing);
    EXPECT_EQ(found.holes, 0u);
    EXPECT_LE(found.discs_holes, 5u);
    // The noise of a point is averaged over its neighbours.
    EXPECT_LE(found.to_mesh.rms, (0.03 + 0.5 * noise) * found.spacing);
    EXPECT_LE(found.from_mesh.rms, (0.03 + 0.5 * noise) * found.spacing);
    EXPECT_LE(found.views.normal_degrees.median, 4);
  }
}

}  // namespace
}  // namespace rbvh
