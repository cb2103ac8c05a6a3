// The file's own coordinates, in and out, of scans far from the origin; and what ingest says of such files.
#include <cmath>

#include "io/npy.h"
#include "tests/cli/pair_tool_test.h"

namespace rbvh {
namespace {

constexpr double kEast = 458100, kNorth = 5432800;

class Frame : public PairToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("a.obj", tile(0));
    write("b.obj", tile(10));
  }
  /// A wavy square of 10, 10 apart from the next.
  static std::string tile(double x0) {
    std::string text;
    char line[128];
    for (int y = 0; y <= 20; ++y)
      for (int x = 0; x <= 20; ++x) {
        std::snprintf(line, sizeof line, "v %.3f %.3f %.3f\n", kEast + x0 + x * 0.5, kNorth + y * 0.5,
                      430 + 0.2 * std::sin(x * 0.7));
        text += line;
      }
    for (int y = 0; y < 20; ++y)
      for (int x = 0; x < 20; ++x) {
        const int i = 1 + x + 21 * y;
        text += "f " + std::to_string(i) + " " + std::to_string(i + 1) + " " + std::to_string(i + 22) + " " +
                std::to_string(i + 21) + "\n";
      }
    return text;
  }
  /// Doubles, as numpy saves them.
  void write_doubles(const std::string& name, const std::vector<double>& values, std::size_t columns) const {
    std::string header = "{'descr': '<f8', 'fortran_order': False, 'shape': (" +
                         std::to_string(values.size() / columns) + ", " + std::to_string(columns) + "), }";
    header.append(117 - header.size(), ' ');
    header += '\n';
    std::string bytes("\x93NUMPY\x01\x00\x76\x00", 10);
    write(name,
          bytes + header +
              std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double)));
  }
  FloatTable table(const std::string& name) const {
    static constexpr std::size_t kColumns[] = {1, 3, 8};
    return read_npy(path(name), kColumns);
  }
};

TEST_F(Frame, RaysCamerasAndBoundsAreTheFiles) {
  good("ingest a.obj -o a.ply");
  good("build a.ply -o a.rbvh --levels Q0");
  good("proxy a.ply -o p.obj --patches 8");
  write_doubles("rays.npy", {kEast + 3.3, kNorth + 7.1, 440, 0, 0, -1}, 6);
  const std::string view =
      " --resolution 32,32 --camera-position 458105,5432805,460 --camera-focal-point "
      "458105,5432805,430 --camera-view-up 0,1,0 ";
  for (const std::string file : {"a.obj", "a.ply", "a.rbvh", "p.obj"}) {
    const Json json = info(file);
    const Json& box = json.contains("source") && json["source"].contains("bounds") ? json["source"] : json;
    EXPECT_NEAR(box["bounds"]["lo"][0].get<double>(), kEast, 0.02) << file;
    EXPECT_NEAR(box["bounds"]["hi"][1].get<double>(), kNorth + 10, 0.02) << file;
    good("trace " + file + " --rays rays.npy -o hits.npy -f");
    EXPECT_NEAR(table("hits.npy").values[0], 10, 0.25) << file;
    good("render " + file + view + "--aov position -o p.exr -f");
    const ToolRun run = tool("render " + file + view + "-o p.png -f");
    EXPECT_EQ(run.err.find("warning"), std::string::npos) << file << ": " << run.err;
    const ToolRun away = tool("render " + file + view + "--coordinates shifted -o away.png -f");
    EXPECT_EQ(away.code, 0);
    EXPECT_NE(away.err.find("nothing is in view"), std::string::npos) << away.err;
    good("trace " + file + " --coordinates shifted --rays rays.npy -o shifted.npy -f");
    EXPECT_TRUE(std::isinf(table("shifted.npy").values[0])) << file;
  }
}

TEST_F(Frame, FloatRaysTooCoarseAreNamed) {
  write_npy(path("rays.npy"), std::vector<float>{458103, 5432807, 440, 0, 0, -1}, 6, true);
  const ToolRun run = tool("trace a.obj --rays rays.npy -o hits.npy");
  EXPECT_EQ(run.code, 0);
  EXPECT_NE(run.err.find("float64"), std::string::npos) << run.err;
}

TEST_F(Frame, TilesOfASceneLieSideBySide) {
  for (const std::string name : {"a", "b"}) {
    good("ingest " + name + ".obj -o " + name + ".ply");
    good("build " + name + ".ply -o " + name + ".rbvh --levels Q4");
    good("proxy " + name + ".ply -o p" + name + ".obj --patches 8");
  }
  write_doubles("rays.npy", {kEast + 5, kNorth + 5, 440, 0, 0, -1, kEast + 15, kNorth + 5, 440, 0, 0, -1}, 6);
  for (const auto& [a, b] : {std::pair{"a.obj", "b.obj"},
                             {"a.ply", "b.ply"},
                             {"a.rbvh", "b.rbvh"},
                             {"pa.obj", "pb.obj"},
                             {"a.obj", "b.rbvh"}}) {
    write("s.json", std::string("{\"rbvh_scene\": 1, \"objects\": {\"a\": {\"file\": \"") + a +
                        "\"}, \"b\": {\"file\": \"" + b +
                        "\"}}, \"instances\": [{\"object\": \"a\"}, {\"object\": \"b\"}]}");
    const Json box = info("s.json")["bounds"];
    EXPECT_NEAR(box["lo"][0].get<double>(), kEast, 0.1) << a;
    EXPECT_NEAR(box["hi"][0].get<double>(), kEast + 20, 0.1) << a;
    good("trace s.json --rays rays.npy -o hits.npy -f");
    const FloatTable hits = table("hits.npy");
    EXPECT_NEAR(hits.values[0], 10, 0.3) << a;
    EXPECT_NEAR(hits.values[8], 10, 0.3) << b;
  }
}

TEST_F(Frame, FocusAndPointsAreTheFiles) {
  good("build a.obj -o flat.rbvh --levels Q3 --levels-by density");
  good(
      "build a.obj -o fine.rbvh --levels Q3 --levels-by density --focus 458105,5432805,430 --focus-radius 2");
  good(
      "build a.obj -o away.rbvh --levels Q3 --levels-by density --coordinates shifted --focus "
      "458105,5432805,430 --focus-radius 2");
  EXPECT_GT(bytes("fine"), bytes("flat"));
  EXPECT_LT(bytes("away"), bytes("fine"));
  write_doubles("points.npy", {kEast + 5, kNorth + 5, 430 + 0.2 * std::sin(7.0)}, 3);
  write_npy(path("values.npy"), std::vector<float>{7}, 1, true);
  good("paint flat.rbvh --layer wear --points points.npy --values values.npy --radius 1 -o worn.rbvh");
  good("sample worn.rbvh --layer wear --points points.npy -o read.npy");
  EXPECT_NEAR(table("read.npy").values[0], 7, 0.01);
  good("sample worn.rbvh --layer wear --points points.npy --coordinates shifted -o none.npy");
  EXPECT_TRUE(std::isnan(table("none.npy").values[0]));
  EXPECT_NE(tool("paint flat.rbvh --layer wear --points points.npy --values values.npy --coordinates shifted "
                 "-o x.rbvh")
                .err.find("paint nothing"),
            std::string::npos);
}

TEST_F(Frame, IngestNamesColumnsFarPointsAndWinding) {
  write("c.csv", "P1,1,2,3\nP2,2,2,3\nP3,1,3,3\n");
  bad("ingest c.csv -o c.ply", 3, "--columns x=1,y=2,z=3");
  good("ingest c.csv -o c.ply --columns x=2,y=3,z=4");
  bad("ingest a.obj -o d.ply --columns x=2,y=3,z=4", 2, "text cloud");
  std::string cloud;
  for (int i = 0; i < 400; ++i)
    cloud += std::to_string(kEast + i % 20 * 0.01) + " " + std::to_string(kNorth + i / 20 * 0.01) + " 430\n";
  write("e.xyz", cloud + "0 0 0\n0 0 0\n");
  EXPECT_NE(tool("ingest e.xyz -o e.ply").err.find("2 points lie far"), std::string::npos);
  EXPECT_EQ(info("e.ply")["vertices"], 401);
  EXPECT_NE(tool("ingest e.xyz --remove-far -o f.ply").err.find("2 far points"), std::string::npos);
  EXPECT_EQ(info("f.ply")["vertices"], 400);
  write("w.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 3 4\n");
  EXPECT_NE(tool("ingest w.obj --winding keep -o w.ply")
                .err.find("1 of 1 edge between faces that are wound opposite ways"),
            std::string::npos);
  EXPECT_NE(tool("ingest w.obj --winding orient -o o.ply").err.find("1 face turned"), std::string::npos);
  EXPECT_EQ(tool("ingest o.ply -o again.ply").err.find("winding"), std::string::npos);
}

}  // namespace
}  // namespace rbvh
