// Real scans, where the folder named by RBVH_SCANS has them.
#include <cstdlib>
#include <filesystem>

#include "pipeline/measure/surface_distance.h"
#include "pipeline/proxy/bake.h"
#include "pipeline/proxy/check_proxy.h"
#include "pipeline/proxy/proxy_surface.h"
#include "pipeline/scan/ingest.h"
#include "tests/scan_bytes.h"

namespace rbvh {
namespace {

class RealScans : public ::testing::Test {
 protected:
  RawScan load(const std::string& name) {
    const char* folder = std::getenv("RBVH_SCANS");
    path_ = folder ? std::string(folder) + "/" + name : "";
    if (!folder || !std::filesystem::exists(path_)) return {};
    return read_scan(path_);
  }
  Scan ingested(RawScan raw) { return ingest(std::move(raw), path_, {}, counts_); }
  std::string path_;
  IngestReport counts_;
};

#define LOAD_OR_SKIP(name)  \
  RawScan raw = load(name); \
  if (raw.positions.empty()) GTEST_SKIP() << name " is not there; set RBVH_SCANS to the folder that has it"

TEST_F(RealScans, Dragon) {
  LOAD_OR_SKIP("dragon_vrip.ply");
  EXPECT_EQ(raw.positions.size(), 437645u);
  EXPECT_EQ(raw.triangles.size(), 871414u);
  const Scan scan = ingested(std::move(raw));
  EXPECT_EQ(scan.triangles.size() + counts_.cleaned.zero_area_faces + counts_.cleaned.duplicate_faces,
            871414u);
  EXPECT_LT(counts_.cleaned.zero_area_faces, 200u);
  EXPECT_EQ(scan.shift, Vec3d{});
}

TEST_F(RealScans, BunnyAsAProxy) {
  LOAD_OR_SKIP("stanford-bunny.obj");
  const Scan scan = ingested(std::move(raw));
  BakeConfig config;
  config.max_patches = 500;
  BakeReport counts;
  const Proxy proxy = bake_proxy(scan, path_, config, counts);
  EXPECT_EQ(find_fault(proxy), std::nullopt);
  const TriangleSoup from = surface_of(scan), to = surface_of(proxy);
  const double diagonal = bounds(scan).diagonal();
  EXPECT_LT(sampled_distance(from, ClosestPoint(to), 20'000).rms, 1e-4 * diagonal);
  EXPECT_LT(sampled_distance(to, ClosestPoint(from), 20'000).rms, 1e-4 * diagonal);
}

TEST_F(RealScans, TerrainLosesNothing) {
  LOAD_OR_SKIP("terrain_utm.pcd");
  ASSERT_EQ(raw.positions.size(), 522674u);
  const RawScan before = raw;
  const Scan scan = shift_to_float(std::move(raw));
  EXPECT_NE(scan.shift, Vec3d{});
  for (std::size_t i = 0; i < scan.positions.size(); ++i)
    ASSERT_EQ(static_cast<Vec3d>(scan.positions[i]) + scan.shift, before.positions[i]) << i;
  const Scan clean = ingested(RawScan(before));
  EXPECT_EQ(clean.positions.size() + counts_.cleaned.duplicate_vertices, 522674u);
  std::size_t up = 0;
  for (const Vec3f& n : clean.normals) up += n.z > 0;
  EXPECT_GT(up, clean.normals.size() * 9 / 10);
}

TEST_F(RealScans, RoomSeenFromInside) {
  LOAD_OR_SKIP("room_scan1.pcd");
  EXPECT_EQ(raw.positions.size(), 112586u);
  const Scan scan = ingested(std::move(raw));
  EXPECT_EQ(counts_.cloud.normals_by_viewpoint, scan.positions.size());
}

TEST_F(RealScans, OrganisedFrameWithColours) {
  LOAD_OR_SKIP("region_growing_rgb.pcd");
  EXPECT_EQ(raw.positions.size(), 307200u);
  const Scan scan = ingested(std::move(raw));
  EXPECT_EQ(scan.positions.size() + counts_.cleaned.non_finite_vertices, 307200u);
  EXPECT_EQ(scan.colors.size(), scan.positions.size());
}

TEST_F(RealScans, TurtleKeepsItsIntensity) {
  LOAD_OR_SKIP("cturtle.pcd");
  const Scan scan = ingested(std::move(raw));
  EXPECT_EQ(scan.positions.size(), 167198u);
  ASSERT_EQ(scan.properties.size(), 1u);
  EXPECT_EQ(scan.properties[0].name, "intensity");
  for (const Vec3f& n : scan.normals) ASSERT_LT(n.z, 0);  // the sensor looked along +z
}

TEST_F(RealScans, BunnyIsOpenAtTheBottom) {
  LOAD_OR_SKIP("stanford-bunny.obj");
  EXPECT_EQ(raw.triangles.size(), 69451u);
  const Scan scan = ingested(std::move(raw));
  EXPECT_EQ(scan.triangles.size(), 69451u);
  EXPECT_EQ(counts_.cleaned.unreferenced_vertices, 1113u);
}

TEST_F(RealScans, LidarWithColours) {
  LOAD_OR_SKIP("lidar_color.las");
  ASSERT_EQ(raw.positions.size(), 1065u);
  Bounds3d box;
  for (const Vec3d& p : raw.positions) box.add(p);
  // As its header says.
  EXPECT_NEAR(length(box.lo - Vec3d{635619.85, 848899.70, 406.59}), 0, 1e-6);
  EXPECT_NEAR(length(box.hi - Vec3d{638982.55, 853535.43, 586.38}), 0, 1e-6);
  EXPECT_EQ(raw.colors[0], (Color8{68, 77, 88}));
  EXPECT_EQ(raw.properties[0].values[0], 143);
  EXPECT_EQ(raw.properties[1].values[0], 1);
  const Scan scan = ingested(std::move(raw));
  EXPECT_EQ(scan.positions.size(), 1065u);
  EXPECT_EQ(scan.colors.size(), 1065u);
}

}  // namespace
}  // namespace rbvh
