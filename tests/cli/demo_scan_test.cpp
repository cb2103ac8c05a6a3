// The simulated scanner: what it writes is a scan with a scanner's faults, the same each time.
#include <map>

#include "io/scan_io.h"
#include "tests/run_tool.h"

namespace rbvh {
namespace {

using Edge = std::pair<std::uint32_t, std::uint32_t>;

/// Mean of 1 - cos of the angle between neighbouring triangles.
double roughness(const RawScan& scan) {
  std::map<Edge, Vec3d> first;
  double sum = 0;
  std::size_t pairs = 0;
  for (const Triangle& t : scan.triangles) {
    const Vec3d a = scan.positions[t[0]];
    const Vec3d normal = normalized(cross(scan.positions[t[1]] - a, scan.positions[t[2]] - a));
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [other, is_new] = first.emplace(std::minmax(t[k], t[(k + 1) % 3]), normal);
      if (is_new) continue;
      sum += 1 - dot(normal, other->second);
      ++pairs;
    }
  }
  return sum / static_cast<double>(pairs);
}

class DemoScan : public ToolTest {
 protected:
  void scan(const std::string& words) {
    const ToolRun run = shell("'" RBVH_DEMO_SCAN "' " + words);
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_EQ(run.out, "");
  }
};

TEST_F(DemoScan, AMeshOfAboutTheSizeAskedForWithHolesAndColors) {
  scan("-o mesh.ply --triangles 30000");
  const RawScan mesh = read_scan(path("mesh.ply"));
  EXPECT_GT(mesh.triangles.size(), 20000u);
  EXPECT_LT(mesh.triangles.size(), 40000u);
  EXPECT_EQ(mesh.colors.size(), mesh.positions.size());

  // An edge of one triangle is a hole's; hardly any edge has more than two.
  std::map<Edge, int> edges;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) ++edges[std::minmax(t[k], t[(k + 1) % 3])];
  std::size_t open = 0, crowded = 0;
  for (const auto& [edge, count] : edges) {
    open += count == 1;
    crowded += count > 2;
  }
  EXPECT_GT(open, 100u);
  EXPECT_LT(open, edges.size() / 10);
  EXPECT_LT(crowded, edges.size() / 100);
}

TEST_F(DemoScan, CloudsKnowWhereTheyWereSeenFromAndHaveOutliers) {
  scan("--clouds view --points 20000 --triangles 30000");
  std::size_t points = 0, files = 0;
  RawScan all;
  for (const auto& file : std::filesystem::directory_iterator(folder_)) {
    RawScan cloud = read_scan(file.path().string());
    ASSERT_EQ(cloud.viewpoints.size(), 1u);
    EXPECT_FALSE(cloud.viewpoints[0].is_default);
    EXPECT_EQ(cloud.colors.size(), cloud.positions.size());
    EXPECT_TRUE(cloud.normals.empty());
    // All is seen from outside: nothing lies behind the middle by more than the object's size.
    for (const Vec3d& p : cloud.positions) EXPECT_LT(length(p), 4);
    EXPECT_GT(length(cloud.viewpoints[0].position), 8);
    points += cloud.positions.size();
    ++files;
  }
  EXPECT_EQ(files, 30u);
  EXPECT_GT(points, 15000u);
  EXPECT_LT(points, 25000u);
}

TEST_F(DemoScan, TheSameSeedGivesTheSameBytesHoweverManyThreads) {
  scan("-o one.ply --clouds one --triangles 20000 --threads 1");
  scan("-o two.ply --clouds two --triangles 20000 --threads 3");
  EXPECT_EQ(read("one.ply"), read("two.ply"));
  EXPECT_EQ(read("one01.pcd"), read("two01.pcd"));
  scan("-o three.ply --triangles 20000 --seed 2");
  EXPECT_NE(read("one.ply"), read("three.ply"));
}

TEST_F(DemoScan, NoiseRoughensTheSurface) {
  scan("-o clean.ply --triangles 20000 --noise 0");
  scan("-o noisy.ply --triangles 20000 --noise 0.005");
  const RawScan clean = read_scan(path("clean.ply")), noisy = read_scan(path("noisy.ply"));
  EXPECT_GT(roughness(noisy), 1.2 * roughness(clean));
}

TEST_F(DemoScan, WrongWordsAreAUsageError) {
  EXPECT_EQ(shell("'" RBVH_DEMO_SCAN "'").code, 2);
  EXPECT_EQ(shell("'" RBVH_DEMO_SCAN "' -o x.ply --noise 2").code, 2);
  write("there.ply", "");
  const ToolRun run = shell("'" RBVH_DEMO_SCAN "' -o there.ply --triangles 2000");
  EXPECT_EQ(run.code, 1);
  EXPECT_EQ(run.lines(), 1);
  EXPECT_EQ(read("there.ply"), "");
}

}  // namespace
}  // namespace rbvh
