// rbvh tiles: what the tool writes, read back as a viewer would.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "io/scan_io.h"
#include "tests/run_tool.h"

namespace rbvh {
namespace {

using Json = nlohmann::json;

struct Seen {
  std::size_t tiles = 0;
  std::map<std::string, std::size_t> triangles;  // by level
};

class Tiles : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("ball.ply", ball_ply(250));  // 249,000 triangles: Q0 takes several tiles
    good("ingest ball.ply -o scan.ply");
    good("build scan.ply --levels Q0=2e-6,Q2,Q4 -o scan.rbvh");
  }

  // Content lies in its tile's box, the box in that above, and errors fall.
  void visit(const Json& tile, const std::vector<double>& above, double error, Seen& seen) const {
    const auto box = tile["boundingVolume"]["box"].get<std::vector<double>>();
    ASSERT_EQ(box.size(), 12u);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double half = box[3 + 4 * axis];
      EXPECT_GE(half, 0);
      if (above.empty()) continue;
      EXPECT_LE(std::abs(box[axis] - above[axis]) + half, above[3 + 4 * axis] + 1e-5) << tile.dump();
    }
    EXPECT_LE(tile["geometricError"].get<double>(), error);
    if (tile.contains("content")) {
      const std::string name = tile["content"]["uri"];
      const RawScan mesh = read_scan(path("tiles/" + name));
      ++seen.tiles;
      seen.triangles[name.substr(0, 2)] += mesh.triangles.size();
      for (const Vec3d& p : mesh.positions) {
        const double at[3] = {p.x, -p.z, p.y};  // +Y up in the GLB, +Z in tiles
        for (std::size_t axis = 0; axis < 3; ++axis)
          ASSERT_LE(std::abs(at[axis] - box[axis]), box[3 + 4 * axis] + 1e-5) << name;
      }
    }
    if (tile.contains("children"))
      for (const Json& child : tile["children"]) visit(child, box, tile["geometricError"], seen);
  }
};

TEST_F(Tiles, HoldTheLevelsFromCoarseToFine) {
  good("tiles scan.rbvh -o tiles --report r.json");
  const Json tileset = Json::parse(read("tiles/tileset.json"));
  EXPECT_EQ(tileset["asset"]["version"], "1.1");
  Seen seen;
  visit(tileset["root"], {}, tileset["geometricError"], seen);
  EXPECT_EQ(seen.triangles.size(), 3u);
  EXPECT_GT(seen.tiles, 6u);
  EXPECT_EQ(Json::parse(read("r.json"))["counts"]["tiles"], seen.tiles);
  for (const auto& [level, triangles] : seen.triangles) {
    good("mesh scan.rbvh --level " + level + " -o m.ply -f");
    EXPECT_EQ(read_scan(path("m.ply")).triangles.size(), triangles) << level;
  }
  const std::string first = read("tiles/tileset.json");
  good("tiles scan.rbvh -o tiles --level Q4 -f");
  EXPECT_EQ(files().find("Q0"), std::string::npos);
  good("tiles scan.rbvh -o tiles --level all -f");
  EXPECT_EQ(read("tiles/tileset.json"), first);
}

TEST_F(Tiles, StandWhereTheScanDoesInMetres) {
  std::string utm =
      "ply\nformat ascii 1.0\ncomment units mm\nelement vertex 4\nproperty double x\nproperty double y\n"
      "property double z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n";
  for (const char* corner : {"0 0 0", "900 0 0", "0 900 0", "0 0 900"}) {
    double x = 0, y = 0, z = 0;
    ASSERT_EQ(std::sscanf(corner, "%lf %lf %lf", &x, &y, &z), 3);
    utm += std::to_string(458000e3 + x) + " " + std::to_string(5e6 + y) + " " + std::to_string(z) + "\n";
  }
  write("utm.ply", utm + "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n");
  good("ingest utm.ply --units mm -o u.ply");
  good("build u.ply --levels Q0 -o u.rbvh");
  good("tiles u.rbvh -o tiles");
  const Json root = Json::parse(read("tiles/tileset.json"))["root"];
  const auto m = root["transform"].get<std::vector<double>>();
  const auto box = root["boundingVolume"]["box"].get<std::vector<double>>();
  EXPECT_NEAR(m[0], 1e-3, 1e-12);
  EXPECT_NEAR(m[12] + m[0] * box[0], 458000.45, 1e-3);  // metres
  EXPECT_NEAR(m[13] + m[5] * box[1], -0.45, 1e-3);      // +Y of the scan is up: its z comes toward the viewer
  EXPECT_NEAR(m[14] + m[10] * box[2], 5000.45, 1e-3);
}

TEST_F(Tiles, ReplaceNothingElse) {
  bad("tiles scan.ply -o tiles", 3, "no .rbvh pair");
  bad("tiles scan.rbvh -o no/tiles", 1, "no folder can be made");
  bad("tiles scan.rbvh -o scan.ply -f", 1, "is no folder");
  std::filesystem::create_directory(path("mine"));
  write("mine/notes.txt", "keep");
  bad("tiles scan.rbvh -o mine -f", 1, "notes.txt");
  std::filesystem::create_directory(path("old"));
  good("tiles scan.rbvh -o old/");
  bad("tiles scan.rbvh -o old", 1, "not empty");
  EXPECT_EQ(read("mine/notes.txt"), "keep");
  std::filesystem::create_directory(path("models"));
  write("models/car.glb", "keep");
  bad("tiles scan.rbvh -o models -f", 1, "car.glb");
  write("models/tileset.json", "{\"asset\": {\"generator\": \"other\"}}");
  bad("tiles scan.rbvh -o models -f", 1, "of no tileset");
  EXPECT_EQ(read("models/car.glb"), "keep");
}

}  // namespace
}  // namespace rbvh
