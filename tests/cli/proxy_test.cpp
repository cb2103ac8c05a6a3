// rbvh proxy through the binary, and its results in info, validate and, where it is installed, Blender.
#include <OpenImageIO/imageio.h>

#include <nlohmann/json.hpp>

#include "io/polygon_obj.h"
#include "io/proxy_file.h"
#include "pipeline/proxy/proxy_surface.h"
#include "tests/run_tool.h"

namespace rbvh {
namespace {

using Json = nlohmann::json;

// A closed bumpy sphere of 8 n^2 triangles.
std::string sphere_obj(int n) {
  std::string vertices, faces;
  int count = 0;
  const auto triangle = [&](std::array<std::array<int, 3>, 3> corners, std::array<int, 3> sign) {
    for (const auto& c : corners) {
      double p[3], length = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        p[k] = sign[k] * c[k];
        length += p[k] * p[k];
      }
      length = std::sqrt(length);
      const double r = (1 + 0.05 * std::sin(6 * p[0] / length) * std::cos(5 * p[1] / length)) / length;
      char line[96];
      std::snprintf(line, sizeof line, "v %.7g %.7g %.7g\n", p[0] * r + 0.0, p[1] * r + 0.0, p[2] * r + 0.0);
      vertices += line;
    }
    const bool turns = sign[0] * sign[1] * sign[2] < 0;
    char line[64];
    std::snprintf(line, sizeof line, "f %d %d %d\n", count + 1, count + (turns ? 3 : 2),
                  count + (turns ? 2 : 3));
    faces += line;
    count += 3;
  };
  for (int octant = 0; octant < 8; ++octant) {
    const std::array<int, 3> sign = {octant & 1 ? -1 : 1, octant & 2 ? -1 : 1, octant & 4 ? -1 : 1};
    for (int i = 0; i < n; ++i)
      for (int j = 0; i + j < n; ++j) {
        const int k = n - i - j;
        triangle({{{i, j, k}, {i + 1, j, k - 1}, {i, j + 1, k - 1}}}, sign);
        if (k > 1) triangle({{{i + 1, j, k - 1}, {i + 1, j + 1, k - 2}, {i, j + 1, k - 1}}}, sign);
      }
  }
  return vertices + faces;
}

class ProxyStage : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("ball.ply", ball_ply(16));
  }
  Json report(const std::string& words) const {
    const ToolRun run = tool("proxy " + words + " -f --report r.json");
    EXPECT_EQ(run.code, 0) << run.err;
    return Json::parse(read("r.json"), nullptr, false);
  }
  void expect_error(int code, const std::string& words, const std::string& part) const {
    const std::string before = files();
    const ToolRun run = tool("proxy " + words);
    EXPECT_EQ(run.code, code) << words << "\n" << run.err;
    EXPECT_EQ(run.lines(), 1) << words << "\n" << run.err;
    EXPECT_EQ(run.err.find("rbvh proxy: "), 0u) << run.err;
    EXPECT_NE(run.err.find(part), std::string::npos) << words << "\n" << run.err;
    EXPECT_EQ(files(), before) << words;
  }

  // A map of 8 x 8 texels, all of them `texel`.
  void write_map(const std::string& name, std::vector<float> texel,
                 OIIO::TypeDesc type = OIIO::TypeFloat) const {
    const int channels = static_cast<int>(texel.size());
    std::vector<float> values;
    for (int i = 0; i < 64; ++i) values.insert(values.end(), texel.begin(), texel.end());
    const auto out = OIIO::ImageOutput::create(path(name));
    ASSERT_NE(out, nullptr);
    OIIO::ImageSpec spec(8, 8, channels, type);
    ASSERT_TRUE(out->open(path(name), spec));
    ASSERT_TRUE(out->write_image(OIIO::TypeFloat, values.data()));
    out->close();
  }
  // Two quads in the plane z = 0, side by side in the map, too.
  void write_quads(const std::string& faces = "f 1/1 2/2 5/5 4/4\nf 2/2 3/3 6/6 5/5\n") const {
    write("quads.obj",
          "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\n"
          "vt 0 0\nvt 0.5 0\nvt 1 0\nvt 0 1\nvt 0.5 1\nvt 1 1\n" +
              faces);
  }
  Bounds3f box(const std::string& name) const { return surface_bounds(load_proxy(path(name))); }
};

TEST_F(ProxyStage, BakesAndReports) {
  const Json json = report("ball.ply -o ball.obj --patches 60");
  EXPECT_EQ(files(), "ball.obj ball.ply ball.vdm.exr ball.vdm.json r.json");
  EXPECT_LE(json["counts"]["patches"], 60);
  EXPECT_EQ(json["counts"]["projected_texels"], 0);
  EXPECT_LT(json["distance"]["proxy_to_scan"]["rms_percent"], 0.05);
  EXPECT_GE(json["distortion"]["stretch_median"], 1);
  EXPECT_EQ(json["bytes"]["map"], std::filesystem::file_size(path("ball.vdm.exr")));
  EXPECT_GT(json["timings"]["decimate"], 0);
}

TEST_F(ProxyStage, OptionsShapeTheBake) {
  const Json few = report("ball.ply -o a.obj --patches 20"),
             bound = report("ball.ply -o a.obj --max-error 0.2");
  EXPECT_LE(few["counts"]["patches"], 20);
  EXPECT_GT(bound["counts"]["patches"], 60);
  const Json coarse = report("ball.ply -o a.obj --patches 20 --detail 1"),
             shallow = report("ball.ply -o a.obj --patches 20 --max-side 5");
  EXPECT_LT(coarse["counts"]["texels"], few["counts"]["texels"]);
  EXPECT_LE(shallow["counts"]["texels"], 20 * 25);
  write("two.obj", "v 0 0 0\nv 9 0 0\nv 0 9 0\nv 20 0 0\nv 20.1 0 0\nv 20 0.1 0\nf 1 2 3\nf 4 5 6\n");
  EXPECT_EQ(report("two.obj -o a.obj")["counts"]["small_components"], 1);
  EXPECT_EQ(report("two.obj -o a.obj --min-component 0")["counts"]["small_components"], 0);
}

TEST_F(ProxyStage, InfoAndValidateKnowIt) {
  ASSERT_EQ(tool("proxy ball.ply -o ball.obj --patches 60 -q").code, 0);
  const Json info = Json::parse(tool("info ball.obj --json").out);
  EXPECT_EQ(info["kind"], "proxy");
  EXPECT_LE(info["patches"], 60);
  EXPECT_EQ(info["source"]["name"], "ball.ply");
  EXPECT_NE(tool("info ball.obj").out.find("ball.obj: proxy, format 1.0"), std::string::npos);
  const Json whole = Json::parse(tool("validate ball.obj --against ball.ply --json").out);
  EXPECT_EQ(whole["valid"], true);
  EXPECT_LT(whole["distance"]["scan_to_proxy"]["rms_percent"], 0.05);
  EXPECT_NE(tool("validate ball.obj --against ball.ply").out.find("scan_to_proxy: rms"), std::string::npos);
  std::filesystem::resize_file(path("ball.vdm.exr"), 1000);
  EXPECT_EQ(tool("validate ball.obj").code, 3);
  EXPECT_EQ(tool("info ball.obj").code, 3);
}

TEST_F(ProxyStage, IsNoScan) {
  ASSERT_EQ(tool("proxy ball.ply -o ball.obj --patches 60 -q").code, 0);
  for (const char* words : {"ingest ball.obj -o a.ply", "build ball.obj -o a.rbvh", "proxy ball.obj -o a.obj",
                            "validate ball.obj --against ball.obj"}) {
    const ToolRun run = tool(words);
    EXPECT_EQ(run.code, 3) << words;
    EXPECT_NE(run.err.find("ball.obj: is a proxy"), std::string::npos) << run.err;
  }
  // Nor without its sidecar.
  std::filesystem::remove(path("ball.vdm.json"));
  for (const char* words : {"build ball.obj -o a.rbvh", "validate ball.obj", "render ball.obj -o a.png"}) {
    const ToolRun run = tool(words);
    EXPECT_EQ(run.code, 3) << words;
    EXPECT_NE(run.err.find("bring all"), std::string::npos) << run.err;
  }
}

TEST_F(ProxyStage, WhatCannotBeBaked) {
  write("cloud.xyz", "0 0 0\n1 0 0\n0 1 0\n0 0 1\n");
  expect_error(3, "cloud.xyz -o a.obj", "point cloud");
  expect_error(5, "ball.ply -o a.obj --patches 1", "patches");
  expect_error(5, "ball.ply -o a.obj --memory 100k", "--memory");
  expect_error(3, "none.ply -o a.obj", "none.ply");
  expect_error(2, "ball.ply -o a.ply", ".obj");
  expect_error(2, "ball.ply -o -", "three files");
  expect_error(2, "ball.ply -o a.obj --patches 0", "--patches");
  expect_error(2, "ball.ply -o a.obj --detail 0", "--detail");
  expect_error(2, "ball.ply -o a.obj --max-side 6", "--max-side");
  expect_error(2, "ball.ply -o a.obj --max-error 101", "--max-error");
  expect_error(2, "ball.ply -o a.obj --min-component -1", "--min-component");
  expect_error(2, "ball.ply -o a.obj --vdm-scale 2", "--vdm");
  write("a.vdm.json", "mine");
  expect_error(1, "ball.ply -o a.obj", "a.vdm.json");
}

TEST_F(ProxyStage, ReadsMapsOfOtherPrograms) {
  write_quads();
  write_map("v.exr", {0.25f, 0.5f, 1});
  const auto high = [&](const std::string& words) {
    const ToolRun run = tool("proxy quads.obj -f -q -o p.obj --vdm " + words);
    EXPECT_EQ(run.code, 0) << run.err;
    return box("p.obj").hi;
  };
  EXPECT_EQ(high("v.exr"), (Vec3f{2.25f, 1.5f, 1}));
  EXPECT_EQ(high("v.exr --vdm-space world"), (Vec3f{2.25f, 1.5f, 1}));
  EXPECT_EQ(high("v.exr --vdm-order zxy"), (Vec3f{2.5f, 2, 0.25f}));
  EXPECT_EQ(high("v.exr --vdm-order x-zy"), (Vec3f{2.25f, 2, -0.5f}));
  EXPECT_EQ(high("v.exr --vdm-scale 2"), (Vec3f{2.5f, 2, 2}));
  EXPECT_EQ(high("v.exr --vdm-midlevel 0.25"), (Vec3f{2, 1.25f, 0.75f}));
  // Along tangent (+x here), bitangent (+y) and normal (+z).
  EXPECT_EQ(high("v.exr --vdm-space tangent"), (Vec3f{2.25f, 1.5f, 1}));
  for (const char* program : {"blender", "mudbox", "arnold", "moonray"})
    EXPECT_EQ(high(std::string("v.exr --vdm-preset ") + program), (Vec3f{2.25f, 2, 0.5f})) << program;
  EXPECT_EQ(high("v.exr --vdm-preset vray"), (Vec3f{1.75f, 1, 0.5f}));
  EXPECT_EQ(high("v.exr --vdm-preset vray --vdm-space object"), (Vec3f{2.25f, 1.5f, 1}));
  // One channel: heights.
  write_map("h.exr", {0.5f});
  EXPECT_EQ(high("h.exr --vdm-scale 3"), (Vec3f{2, 1, 1.5f}));
  write_map("h.tif", {1}, OIIO::TypeUInt16);
  EXPECT_EQ(high("h.tif"), (Vec3f{2, 1, 1}));
  write_map("v.png", {1, 1, 1}, OIIO::TypeUInt8);
  EXPECT_EQ(high("v.png --vdm-midlevel 0.5 --vdm-scale 2"), (Vec3f{3, 2, 1}));
}

TEST_F(ProxyStage, OddAssetsAreCounted) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  write_quads();
  write_map("nan.exr", {0, nan, 0});
  EXPECT_EQ(report("quads.obj -o p.obj --vdm nan.exr")["counts"]["bad_texels"], 64);
  EXPECT_EQ(box("p.obj").hi, (Vec3f{2, 1, 0}));
  write_map("huge.exr", {0, 3e38f, 0});
  const ToolRun huge = tool("proxy quads.obj -o p.obj -f --vdm huge.exr");
  EXPECT_NE(huge.err.find("64 texels are not finite, or too large"), std::string::npos) << huge.err;
  write_map("long.exr", {0, 0, 100});
  EXPECT_EQ(report("quads.obj -o p.obj --vdm long.exr")["counts"]["long_patches"], 2);
  write_map("v.exr", {0, 0, 1});
  write_quads("f 1/1 2/2 5/5 4/4\nf 2/2 3/3 6/6\nf 2/2 6/6 5/5\n");
  const Json split = report("quads.obj -o p.obj --vdm v.exr")["counts"];
  EXPECT_EQ(split["split_faces"], 2);
  EXPECT_EQ(split["patches"], 4 + 3 + 3);
  EXPECT_EQ(box("p.obj").hi, (Vec3f{2, 1, 1}));
  write_quads("f 1/1 2/2 5/5 4/4\nf 2/1 3/2 6/5 5/4\n");
  EXPECT_EQ(report("quads.obj -o p.obj --vdm v.exr")["counts"]["overlapping_patches"], 1);
  write_quads("f 1/1 2/2 5/5 4/4\nf 1/1 2/2 3/3 2/2\n");
  EXPECT_EQ(report("quads.obj -o p.obj --vdm v.exr")["counts"]["zero_area_patches"], 1);
  write_quads("f 1/1 2/2 5/5 4/4\nf 1/1 2/2 1/1 2/2\n");
  EXPECT_EQ(report("quads.obj -o p.obj --vdm v.exr")["counts"]["dropped_faces"], 1);
  write_quads();
  const Json coarse = report("quads.obj -o p.obj --vdm v.exr --max-side 3")["counts"];
  EXPECT_EQ(coarse["coarser_patches"], 2);
  EXPECT_NE(tool("proxy quads.obj -o p.obj -f --vdm long.exr").err.find("warning"), std::string::npos);
}

TEST_F(ProxyStage, WhatCannotBeImported) {
  write_quads();
  write_map("v.exr", {0, 0, 1});
  write_map("v2.exr", {0, 0});
  write_map("v.png", {0, 0, 0}, OIIO::TypeUInt8);
  write("text.exr", "no picture");
  expect_error(3, "quads.obj -o p.obj --vdm none.exr", "no such displacement map");
  expect_error(3, "quads.obj -o p.obj --vdm v2.exr", "2 channels");
  expect_error(3, "quads.obj -o p.obj --vdm v.png", "--vdm-midlevel");
  expect_error(3, "quads.obj -o p.obj --vdm text.exr", "EXR");
  std::string cut = read("v.exr");
  write("cut.exr", cut.substr(0, cut.size() - 20));
  expect_error(3, "quads.obj -o p.obj --vdm cut.exr", "cut.exr");
  cut.replace(cut.find("chlist") + 7, 4, "\xff\xff\xff\x7f");  // room for which would be made: 2 GB
  write("claims.exr", cut);
  expect_error(3, "quads.obj -o p.obj --vdm claims.exr", "cut in its header");
  std::string bad = read("v.png");
  bad[18] = '\7';
  write("bad.png", bad);
  expect_error(3, "quads.obj -o p.obj --vdm bad.png", "bad.png");
  write("cut.png", read("v.png").substr(0, 60));
  expect_error(3, "quads.obj -o p.obj --vdm cut.png", "cut in one of its chunks");
  write_quads("f 1/1 2/2 5/5 4/4\nf 2 3 6 5\n");
  expect_error(3, "quads.obj -o p.obj --vdm v.exr", "face 2 has no texture coordinates");
  write_quads("f 1/1 2/2 5/5 9/4\n");
  expect_error(3, "quads.obj -o p.obj --vdm v.exr", "out of range");
  write_quads();
  expect_error(2, "quads.obj -o p.obj --vdm v.exr --vdm-space tanget", "--vdm-space");
  expect_error(2, "quads.obj -o p.obj --vdm v.exr --vdm-order xxy", "--vdm-order");
  expect_error(2, "quads.obj -o p.obj --vdm v.exr --vdm-preset maya", "maya");
  expect_error(2, "quads.obj -o p.obj --vdm v.exr --vdm-scale big", "--vdm-scale");
  expect_error(2, "quads.obj -o p.obj --vdm v.exr --patches 5", "--patches");
  expect_error(2, "quads.obj -o p.obj --vdm v.exr --vdm-scale 1e39", "--vdm-scale");
  expect_error(2, "quads.obj -o p.obj --vdm v.exr --vdm-midlevel -1e19", "--vdm-midlevel");
  write_map("large.exr", {0, 0, 1e10f});
  expect_error(3, "quads.obj -o p.obj --vdm large.exr --vdm-scale 1e10", "--vdm-scale");
  expect_error(3, "ball.ply -o p.obj --vdm v.exr", "must be an OBJ of quads");
  EXPECT_FALSE(exists("p.obj"));
}

// Where the map has seams, both sides get one edge; an own proxy comes back as it went.
TEST_F(ProxyStage, SeamsAreWelded) {
  // Both quads see the whole map, so that the shared edge is right in one and left in the other.
  write_quads("f 1/1 2/3 5/6 4/4\nf 2/1 3/3 6/6 5/4\n");
  std::vector<float> values;
  for (int i = 0; i < 64; ++i) values.insert(values.end(), {0, 0, static_cast<float>(i % 8)});
  const auto out = OIIO::ImageOutput::create(path("ramp.exr"));
  ASSERT_TRUE(out->open(path("ramp.exr"), OIIO::ImageSpec(8, 8, 3, OIIO::TypeFloat)));
  ASSERT_TRUE(out->write_image(OIIO::TypeFloat, values.data()));
  out->close();
  EXPECT_EQ(report("quads.obj -o p.obj --vdm ramp.exr")["counts"]["welded_edges"], 1);

  write("sphere.obj", sphere_obj(24));
  ASSERT_EQ(tool("proxy sphere.obj -o ball.obj --patches 40 -q").code, 0);
  EXPECT_EQ(report("ball.obj --vdm ball.vdm.exr -o again.obj")["counts"]["welded_edges"], 0);
  const TriangleSoup a = surface_of(load_proxy(path("ball.obj"))),
                     b = surface_of(load_proxy(path("again.obj")));
  ASSERT_EQ(a.size(), b.size());
  float worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, length(a[i] - b[i]));
  EXPECT_LT(worst, 1e-5f);
}

// docs/proxy.md says how to open a proxy in Blender: does the surface come out there that we have?
TEST_F(ProxyStage, OpensInBlender) {
  if (shell("command -v blender").code != 0) GTEST_SKIP() << "Blender is not installed (package blender)";
  // All tiles alike, so that Blender's vertices are texels.
  write("sphere.obj", sphere_obj(24));
  ASSERT_EQ(tool("proxy sphere.obj -o ball.obj --patches 40 --max-side 9 --detail 0.0001 -q").code, 0);
  const Proxy proxy = load_proxy(path("ball.obj"));
  for (const PatchTile& tile : proxy.tiles) ASSERT_EQ(tile.side, 9u);
  const ToolRun run =
      shell("blender --background --factory-startup --python-exit-code 1 --python '" RBVH_SOURCE
            "/tests/blender/displace.py' -- ball.obj 3 out.obj");
  ASSERT_EQ(run.code, 0) << run.out << run.err;
  const PolygonMesh mesh = read_polygon_obj(read("out.obj"), "out.obj");
  EXPECT_EQ(mesh.face_count(), proxy.quads.size() * 64);
  const ClosestPoint ours(surface_of(proxy));
  double worst = 0;
  for (const Vec3d& p : mesh.positions) worst = std::max<double>(worst, ours.distance(Vec3f(p)));
  RecordProperty("worst_distance", std::to_string(worst));
  EXPECT_LT(worst, 1e-5 * box("ball.obj").diagonal());
}

}  // namespace
}  // namespace rbvh
