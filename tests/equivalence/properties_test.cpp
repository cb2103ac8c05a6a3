// What must hold of any scan: height fields come back, and no hit is further from the scan than its level
// says.
#include <gtest/gtest.h>

#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/surface_distance.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/rbvh/tile.h"
#include "pipeline/rbvh/trace_rbvh.h"
#include "tests/exact_scenes.h"
#include "tests/property.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

struct Frame {
  Vec3f origin, x, y, z;
  Vec3f at(float u, float v, float w) const { return origin + x * u + y * v + z * w; }
};

Frame random_frame(Random& random) {
  const Vec3f z = uniform_direction(random), x = normalized(cross(z, uniform_direction(random)));
  return {uniform_point(random, 2), x, cross(z, x), z};
}

/// How high the mesh is over a point, along `up`, by each of its triangles; NaN where none is.
double height_over(const Scan& scan, Vec3d from, Vec3d up) {
  for (const Triangle& t : scan.triangles) {
    const oracle::Meeting meeting =
        oracle::meet_triangle(point(scan.positions[t[0]]), point(scan.positions[t[1]]),
                              point(scan.positions[t[2]]), {from.x, from.y, from.z}, {up.x, up.y, up.z});
    if (meeting.crosses && meeting.inside > 1e-6) return meeting.t;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

TEST(Properties, RandomHeightFieldsComeBackWithinHalfAQuantum) {
  Random random(property_seed());
  const Device device = Device::open();
  for (int trial = 0; trial < 12; ++trial) {
    const Frame frame = random_frame(random);
    const int cells = 3 + static_cast<int>(random() % 12);
    // Slopes of up to 45 degrees within a cell, and hills of half the field.
    const float rough = uniform(random, 0, 0.5f) / static_cast<float>(cells),
                hill = uniform(random, 0, 0.15f);
    Scan scan;
    add_sheet(scan, cells, [&](float s, float t) {
      return frame.at(s, t, hill * std::sin(6 * s) * std::cos(5 * t) + uniform(random, -rough, rough));
    });
    const Primitives primitives = upload_primitives(device, scan);
    const Partition partition = make_root(primitives, false);
    TileTexels texels;
    const Tile tile = rasterize_tiles(
        primitives, partition, {0},
        RasterConfig{.rho = uniform(random, 300, 3000) / partition.nodes[0].sums.area},
        [](const Tile&) { return true; }, texels)[0];
    const TileFrame to_space(tile.leaf);
    const double quantum = length(to_space.w);
    int compared = 0;
    for (std::uint32_t y = 0; y < tile.leaf.height; ++y)
      for (std::uint32_t x = 0; x < tile.leaf.width; ++x) {
        const Vec3d foot =
            to_space.origin + to_space.u * static_cast<double>(x) + to_space.v * static_cast<double>(y);
        const double height = height_over(scan, foot, to_space.w);  // in quanta
        if (std::isnan(height)) continue;
        ++compared;
        const std::uint16_t stored = texels.heights[y * tile.leaf.width + x];
        ASSERT_NE(stored, 0) << "trial " << trial << " texel " << x << "," << y;
        // What float makes of coordinates of this size comes on top.
        EXPECT_NEAR(stored, height, 0.5 + 1e-6 / quantum) << "trial " << trial << " texel " << x << "," << y;
      }
    EXPECT_GT(compared, 200);
  }
}

/// Rays from everywhere to points on and near the scan.
std::vector<Ray> rays_at(Random& random, const Scan& scan, std::size_t count) {
  const Bounds3f box = bounds(scan);
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f at =
        scan.positions[random() % scan.positions.size()] + uniform_point(random, 0.05f * box.diagonal());
    const Vec3f from = box.center() + uniform_direction(random) * (box.diagonal() * uniform(random, 0, 1.5f));
    rays.push_back(make_ray(from, at - from));
  }
  return rays;
}

TEST(Properties, AnyRaysHitLiesWithinTheLevelsStatedErrorOfTheScan) {
  Random random(property_seed());
  const Device device = Device::open();
  std::vector<Scan> scans = {bumpy_sphere(90, 0.1f), globe(random, 24, 36)};
  // Sheets that cross, and a thin one: folds, steps and back faces.
  scans.push_back(bumpy_sphere(40));
  add_sheet(scans.back(), 12, [](float s, float t) {
    return Vec3f{2.4f * s - 1.2f, 2.4f * t - 1.2f, 0.3f * s};
  });
  for (std::size_t k = 0; k < scans.size(); ++k) {
    const Scan& scan = scans[k];
    const ClosestPoint surface(surface_of(scan));
    const std::vector<Ray> rays = rays_at(random, scan, 20000);
    for (const Hybrid hybrid : {Hybrid::kOff, Hybrid::kAuto}) {
      BuildConfig config;
      config.levels = {standard_levels()[2], standard_levels()[4]};
      config.hybrid = hybrid;
      for (const Level& level : build_rbvh(device, scan, config).levels) {
        // As `build --measure` states it.
        const double stated = sampled_distance(surface_of(level), surface, 200000).max;
        const Buffer<Hit> hits(device, rays.size());
        trace_rays(make_rbvh_tracer(device, level), Buffer<Ray>(device, rays), hits, rays.size(),
                   RayQuery::kNearest);
        double worst = 0;
        std::size_t found = 0;
        const std::vector<Hit> all = hits.read();
        for (std::size_t i = 0; i < rays.size(); ++i) {
          if (all[i].leaf == RBVH_NO_LEAF) continue;
          ++found;
          const Ray& r = rays[i];
          const Vec3f at = Vec3f{r.origin[0], r.origin[1], r.origin[2]} +
                           Vec3f{r.direction[0], r.direction[1], r.direction[2]} * all[i].t;
          worst = std::max(worst, static_cast<double>(surface.distance(at)));
        }
        EXPECT_GT(found, rays.size() / 3);
        // The largest distance is told from points, which can miss a peak; there are narrow ones where tiles
        // must show what they cannot, since no leaf keeps its triangles.
        const double slack = hybrid == Hybrid::kOff ? 1.6 : 1.05;
        EXPECT_LE(worst, slack * stated + 2e-6 * static_cast<double>(bounds(scan).diagonal()))
            << "scan " << k << " " << level.name << " hybrid " << static_cast<int>(hybrid);
      }
    }
  }
}

}  // namespace
}  // namespace rbvh
