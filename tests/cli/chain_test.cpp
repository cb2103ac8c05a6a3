// Whole chains through the binary on a small mesh and a small cloud.
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "io/npy.h"
#include "rbvh/geometry.h"
#include "tests/picture.h"
#include "tests/run_tool.h"

namespace rbvh {
namespace {

using Json = nlohmann::json;

class Chain : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("ball.ply", ball_ply(48));
  }
  void build() { good("build ball.ply -o ball.rbvh"); }
  Picture picture(const std::string& name) const { return read_picture(path(name)); }
  static constexpr const char* kFront =
      " --camera-position 0,0,6 --camera-focal-point 0,0,0 --resolution 65,33";
};

TEST_F(Chain, LevelsAreByErrorOrByDensity) {
  const auto level = [&](const std::string& words) {
    good("build ball.ply -o ball.rbvh -f --levels Q2 --levels-by " + words);
    return Json::parse(tool("info ball.rbvh --json").out).at("levels").at(0);
  };
  const Json by_error = level("error"), by_density = level("density --hybrid off");
  EXPECT_GT(by_error.at("error").get<double>(), 0);
  EXPECT_EQ(by_error.at("primitive_leaves"), by_error.at("leaves"))
      << "a small mesh: triangles are fewer bytes";
  EXPECT_EQ(by_density.at("error").get<double>(), 0);
  EXPECT_EQ(by_density.at("primitive_leaves").get<int>(), 0);
  EXPECT_LT(by_error.at("bytes").get<double>(), 0.2 * by_density.at("bytes").get<double>());
}

TEST_F(Chain, APairIsBuiltAndRenderedAtEveryLevel) {
  build();
  EXPECT_EQ(files(), "ball.atlas.tif ball.ply ball.rbvh");
  good("render ball.rbvh -o '{name}-{level}.png' --level all --resolution 64,64");
  EXPECT_EQ(files(),
            "ball-Q0.png ball-Q1.png ball-Q2.png ball-Q3.png ball-Q4.png ball.atlas.tif ball.ply ball.rbvh");
  const Picture p = picture("ball-Q0.png");
  EXPECT_EQ(p.width, 64);
  EXPECT_EQ(p.channels, 4);
  EXPECT_EQ(p.at(32, 32)[3], 1);
  EXPECT_EQ(p.at(0, 0)[3], 0);
  const ToolRun wrong = tool("render ball.rbvh -o x.png --level Q7");
  EXPECT_EQ(wrong.code, 2);
  EXPECT_EQ(wrong.lines(), 1) << wrong.err;
  good("render ball.rbvh ball.ply -o 'both-{name}-{level}.png' --resolution 16,16");
  EXPECT_TRUE(exists("both-ball-Q0.png") && exists("both-ball-exact.png"));
  std::filesystem::create_directory(path("x"));
  std::filesystem::copy(path("ball.ply"), path("x/ball.ply"));
  EXPECT_EQ(tool("render ball.ply x/ball.ply -o '{name}-{level}.png' --resolution 16,16").code, 2);
  good("render ball.ply -o exact.png --level Q7 --resolution 64,64");  // a scan has no levels
}

TEST_F(Chain, TracersAndBuildersShowTheSame) {
  good("render ball.ply -o default.exr --aov depth --resolution 64,64");
  const std::vector<float> expected = picture("default.exr").pixels;
  for (const char* words : {"--tracer bvh-stack --builder lbvh", "--tracer bvh-trail --builder ploc",
                            "--tracer bvh-parent --builder sah", "--builder lbvh", "--tracer kd-stack",
                            "--tracer kd-pushdown --builder kd", "--tracer kd-backtrack"}) {
    good(std::string("render ball.ply -f -o other.exr --aov depth --resolution 64,64 ") + words);
    EXPECT_EQ(picture("other.exr").pixels, expected) << words;
  }
  good("render ball.ply -o difference.png --compare wide16,kd-stack --resolution 64,64 --report r.json");
  EXPECT_EQ(Json::parse(read("r.json"))["counts"]["differing_pixels"], 0);
  EXPECT_EQ(Json::parse(read("r.json"))["tracer"], "wide16");
  EXPECT_EQ(Json::parse(read("r.json"))["compared_with"], "kd-stack");
  EXPECT_EQ(picture("difference.png").channels, 3);
  build();
  for (const char* words : {"--tracer wide16", "--builder lbvh", "--compare wide16,bvh-stack"}) {
    const ToolRun run = tool(std::string("render ball.rbvh -o x.png ") + words);
    EXPECT_EQ(run.code, 2) << words << run.err;
    EXPECT_EQ(run.lines(), 1) << run.err;
  }
}

TEST_F(Chain, LevelsCanBeChosenAtTheBuild) {
  good("build ball.ply -o two.rbvh --levels Q3,Q1");
  good("render two.rbvh -o '{level}.png' --level all --resolution 16,16");
  EXPECT_TRUE(exists("Q1.png") && exists("Q3.png") && !exists("Q0.png"));
  EXPECT_EQ(tool("render two.rbvh -o x.png --level Q0").code, 2);
}

TEST_F(Chain, DepthIsTheDistanceAlongTheRay) {
  build();
  for (const char* file : {"ball.ply", "ball.rbvh"}) {
    good(std::string("render ") + file + " -f -o depth.exr --aov depth" + kFront);
    const Picture p = picture("depth.exr");
    EXPECT_EQ(p.names, std::vector<std::string>{"Z"});
    EXPECT_EQ(p.width, 65);
    EXPECT_NEAR(*p.at(32, 16), 5, 0.03) << file;  // the ball's radius is about 1
    EXPECT_TRUE(std::isinf(*p.at(0, 0))) << file;
  }
}

TEST_F(Chain, TheImageIsTheRightWayUpAndRound) {
  build();
  for (const char* file : {"ball.ply", "ball.rbvh"}) {
    good(std::string("render ") + file + " -f -o position.exr --aov position" + kFront);
    const Picture p = picture("position.exr");
    EXPECT_GT(p.at(32, 12)[1], 0.2f) << "row 0 is on top";
    EXPECT_LT(p.at(32, 20)[1], -0.2f);
    EXPECT_GT(p.at(36, 16)[0], 0.2f) << "right = forward x up";
    EXPECT_LT(p.at(28, 16)[0], -0.2f);
    good(std::string("render ") + file + " -f -o normal.exr --aov normal" + kFront);
    EXPECT_GT(picture("normal.exr").at(32, 16)[2], 0.8f);
  }
}

TEST_F(Chain, EveryAovIsOneImageWithItsOwnChannels) {
  build();
  const std::pair<const char*, std::size_t> kAovs[] = {{"shaded", 4},   {"normal", 3}, {"depth", 1},
                                                       {"position", 3}, {"leaf", 1},   {"steps", 1}};
  for (const auto& [aov, channels] : kAovs) {
    good(std::string("render ball.rbvh -f -o a.exr --aov ") + aov + kFront);
    EXPECT_EQ(picture("a.exr").names.size(), channels) << aov;
  }
  for (const char* aov : {"normal", "leaf", "steps"}) {
    good(std::string("render ball.rbvh -f -o a.png --aov ") + aov + kFront);
    EXPECT_EQ(picture("a.png").channels, 4) << aov;
  }
}

TEST_F(Chain, TurntablesAndCameraFilesGiveNumberedPictures) {
  build();
  good("render ball.rbvh -o 't{frame:03}.png' --turntable 3 --resolution 16,16");
  EXPECT_TRUE(exists("t000.png") && exists("t001.png") && exists("t002.png"));
  EXPECT_NE(read("t000.png"), read("t001.png"));
  write(
      "cameras.json",
      R"({"cameras": [{"position": [0, 0, 6], "focal_point": [0, 0, 0]}, {"azimuth_angle": 90, "view_angle": 20}]})");
  good("render ball.rbvh -o 'c{frame}.png' --cameras cameras.json --resolution 16,16");
  good(
      "render ball.rbvh -o 'c0-again.png' --camera-position 0,0,6 --camera-focal-point 0,0,0 --resolution "
      "16,16");
  EXPECT_EQ(read("c0.png"), read("c0-again.png"));
  EXPECT_TRUE(exists("c1.png"));
  for (const char* wrong :
       {"[", "{}", "[]", "[{\"positon\": [0, 0, 6]}]", "[{\"position\": [0, 6]}]", "[7]"}) {
    write("wrong.json", wrong);
    const ToolRun run = tool("render ball.rbvh -o 'w{frame}.png' --cameras wrong.json");
    EXPECT_EQ(run.code, 3) << wrong << run.err;
    EXPECT_EQ(run.lines(), 1) << run.err;
  }
}

TEST_F(Chain, AnglesTurnTheCamera) {
  const std::string render =
      "render ball.ply --aov position --camera-position 0,0,6 --camera-focal-point 0,0,0 ";
  good(render + "--resolution 33,33 -o front.exr");
  good(render + "--resolution 33,33 --camera-azimuth-angle 90 -o right.exr");
  good(render + "--resolution 33,33 --camera-elevation-angle 60 -o above.exr");
  const auto middle = [&](const char* name) {
    const float* p = picture(name).at(16, 16);
    return normalized(Vec3f{p[0], p[1], p[2]});
  };
  EXPECT_GT(middle("front.exr").z, 0.99f);
  EXPECT_GT(middle("right.exr").x, 0.99f);
  EXPECT_NEAR(middle("above.exr").y, std::sqrt(0.75), 0.05);
}

TEST_F(Chain, ABatchGoesOnPastABadFile) {
  write("bad.ply", "ply\nformat ascii 1.0\nelement vertex 3\n");
  const ToolRun run = tool("render bad.ply ball.ply -o '{name}.png' --resolution 16,16 -q");
  EXPECT_EQ(run.code, 4) << run.err;
  EXPECT_TRUE(exists("ball.png"));
  EXPECT_FALSE(exists("bad.png"));
  EXPECT_NE(run.err.find("bad.ply"), std::string::npos);
}

TEST_F(Chain, EqualWorkGivesEqualBytes) {
  build();
  const std::string pair = read("ball.rbvh"), atlas = read("ball.atlas.tif");
  good("build ball.ply -o ball.rbvh -f --threads 1");
  EXPECT_EQ(read("ball.rbvh"), pair);
  EXPECT_EQ(read("ball.atlas.tif"), atlas);
  for (const char* name : {"a.png", "a.exr"}) {
    good(std::string("render ball.rbvh -f -o ") + name);
    const std::string first = read(name);
    good(std::string("render ball.rbvh --threads 1 -f -o ") + name);
    EXPECT_EQ(read(name), first) << name;
  }
}

TEST_F(Chain, TraceAgreesWithTheScan) {
  build();
  std::vector<float> rays;
  for (int i = 0; i < 50; ++i) {
    const float x = -1.5f + 0.06f * static_cast<float>(i);
    rays.insert(rays.end(), {x, 0.1f, 4, 0, 0, -2});
  }
  const float kNan = std::nanf("");
  rays.insert(rays.end(), {0, 0, 4, 0, 0, 0});
  rays.insert(rays.end(), {kNan, 0, 4, 0, 0, -1});
  write_npy(path("rays.npy"), rays, 6, false);
  const ToolRun run = tool("trace ball.rbvh --rays rays.npy -o hits.npy --report report.json");
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("2 rays"), std::string::npos) << run.err;
  good("trace ball.ply --rays rays.npy -o exact.npy");
  good("trace ball.ply --rays rays.npy -o other.npy --tracer bvh-parent --builder lbvh --report other.json");
  EXPECT_EQ(Json::parse(read("other.json"))["tracer"], "bvh-parent");
  EXPECT_EQ(Json::parse(read("other.json"))["builder"], "lbvh");
  const std::size_t eight[] = {8};
  const FloatTable hits = read_npy(path("hits.npy"), eight), exact = read_npy(path("exact.npy"), eight);
  const FloatTable other = read_npy(path("other.npy"), eight);
  for (std::size_t i = 0; i < exact.values.size(); i += 8) EXPECT_EQ(exact.values[i], other.values[i]);
  ASSERT_EQ(hits.rows, 52u);
  int found = 0;
  for (std::size_t i = 0; i < hits.rows; ++i) {
    const float *h = &hits.values[i * 8], *e = &exact.values[i * 8];
    if (i >= 50) {
      EXPECT_TRUE(std::isinf(h[0]) && std::isinf(e[0]));
      EXPECT_EQ(h[6], -1);
    }
    if (!std::isfinite(h[0]) || !std::isfinite(e[0])) continue;
    ++found;
    EXPECT_NEAR(h[0], e[0], 0.02) << "t is in units of |direction| = 2";
    EXPECT_NEAR(h[1] * h[1] + h[2] * h[2] + h[3] * h[3], 1, 1e-3);
    EXPECT_GT(h[3], 0);
    EXPECT_GE(h[6], 0);
  }
  EXPECT_GE(found, 30);
  const Json report = Json::parse(read("report.json"));
  EXPECT_EQ(report["counts"]["rays"], 52);
  EXPECT_EQ(report["counts"]["unusable_rays"], 2);
}

TEST_F(Chain, TraceKeepsToTheRaysInterval) {
  build();
  write_npy(path("rays.npy"), std::vector<float>{0, 0, 4, 0, 0, -1, 0, 10,  // the front
                                                 0, 0, 4, 0, 0, -1, 4, 10,  // from the middle: the back
                                                 0, 0, 4, 0, 0, -1, 0, 2},  // ends before
            8, false);
  for (const char* file : {"ball.ply", "ball.rbvh"}) {
    good(std::string("trace -f -o hits.npy --rays rays.npy ") + file);
    const std::size_t eight[] = {8};
    const FloatTable hits = read_npy(path("hits.npy"), eight);
    EXPECT_NEAR(hits.values[0], 3, 0.06) << file;
    EXPECT_EQ(static_cast<int>(hits.values[7]) & 1, 0);
    EXPECT_NEAR(hits.values[8], 5, 0.06) << file;
    EXPECT_EQ(static_cast<int>(hits.values[15]) & 1, 1) << "a back face";
    EXPECT_TRUE(std::isinf(hits.values[16])) << file;
    good(std::string("trace -f -o any.npy --any --rays rays.npy ") + file);
    const FloatTable any = read_npy(path("any.npy"), eight);
    EXPECT_TRUE(std::isfinite(any.values[0]) && std::isfinite(any.values[8]) && std::isinf(any.values[16]));
  }
}

TEST_F(Chain, ValidateMeasuresAgainstTheScan) {
  build();
  const ToolRun run =
      tool("validate ball.rbvh --against ball.ply --json --views 2 --resolution 128 --pictures diff -q");
  ASSERT_EQ(run.code, 0) << run.err;
  const Json json = Json::parse(run.out);
  ASSERT_EQ(json["fidelity"].size(), 5u);
  const Json& finest = json["fidelity"][0];
  EXPECT_EQ(finest["level"], "Q0");
  EXPECT_EQ(finest["worst_view"]["holes"], 0);
  EXPECT_LT(finest["dt"]["median"], 1e-3);
  EXPECT_GT(finest["image"]["ssim"], 0.9);
  for (const Json& level : json["fidelity"])  // means over the views, not sums
    for (const char* pictures : {"image", "image_control"}) {
      EXPECT_GT(level[pictures]["ssim"], 0.0) << pictures;
      EXPECT_LE(level[pictures]["ssim"], 1.0) << pictures;
    }
  EXPECT_LT(finest["scan_to_level"]["rms_percent"], 0.5);
  EXPECT_GT(json["fidelity"][4]["dt"]["median"], finest["dt"]["median"]);
  EXPECT_TRUE(exists("diff/Q0-0.png") && exists("diff/Q4-1.png"));
  const std::string again =
      "validate ball.rbvh --against ball.ply --level Q0 --views 1 --resolution 64 --pictures diff -q";
  EXPECT_EQ(tool(again).code, 1) << "the pictures are there";
  EXPECT_EQ(tool(again + " --force").code, 0) << "validate overwrites when told";
  const ToolRun text = tool("validate ball.rbvh --against ball.ply --level Q2 --views 1 --resolution 64 -q");
  EXPECT_EQ(text.code, 0);
  EXPECT_NE(text.out.find("Q2"), std::string::npos);
  EXPECT_EQ(text.out.find("Q0"), std::string::npos);
}

TEST_F(Chain, StandardStreamsWork) {
  EXPECT_EQ(shell("cat ball.ply | '" RBVH_TOOL "' render - -o - --resolution 16,16 -q > piped.png").code, 0);
  good("render ball.ply -o named.png --resolution 16,16");
  EXPECT_EQ(read("piped.png"), read("named.png"));
  for (const char* words :
       {"render ball.ply --resolution 16,16", "render ball.ply --aov depth --resolution 16,16",
        "build ball.ply", "render ball.ply -o a.png --resolution 16,16 -f --report"}) {
    const ToolRun run =
        tool(std::string(words) + (std::string(words).ends_with("report") ? " " : " -o ") + "/dev/full -q");
    EXPECT_EQ(run.code, 1) << words << run.err;
    EXPECT_EQ(run.lines(), 1) << run.err;
  }
  EXPECT_EQ(tool("build ball.ply -o - -q").code, 2) << "a pair is two files";
  const ToolRun full = shell("'" RBVH_TOOL "' render ball.ply -o - --resolution 16,16 -q > /dev/full");
  EXPECT_EQ(full.code, 1);
}

TEST_F(Chain, ProgressReportsAndLogsAreAsAskedFor) {
  const ToolRun nowhere = tool("build ball.ply -o a.rbvh --log none/build.log");
  EXPECT_EQ(nowhere.code, 1);
  EXPECT_NE(nowhere.err.find("there is no folder none"), std::string::npos) << nowhere.err;
  const ToolRun json = tool("build ball.ply -o a.rbvh --progress json --log build.log --report build.json");
  ASSERT_EQ(json.code, 0) << json.err;
  int lines = 0;
  std::istringstream in(json.err);
  for (std::string line; std::getline(in, line);) {
    const Json entry = Json::parse(line);
    EXPECT_EQ(entry["stage"], "build");
    if (!entry.contains("fraction")) continue;  // a line for people
    EXPECT_TRUE(entry["fraction"] >= 0 && entry["fraction"] <= 1);
    ++lines;
  }
  EXPECT_GT(lines, 1);
  EXPECT_NE(read("build.log").find("wrote a.rbvh"), std::string::npos);
  const ToolRun terse = tool("render ball.ply --output x.png --resolution 16,16 --progress plain");
  const ToolRun verbose =
      tool("render ball.ply --output x.png --force --resolution 16,16 --verbose --no-color");
  EXPECT_EQ(terse.err.find("wrote x.png"), std::string::npos) << terse.err;
  EXPECT_NE(verbose.err.find("wrote x.png"), std::string::npos) << verbose.err;
  const Json report = Json::parse(read("build.json"));
  EXPECT_EQ(report["stage"], "build");
  EXPECT_EQ(report["counts"]["triangles"], 9024);
  EXPECT_EQ(report["levels"].size(), 5u);
  EXPECT_TRUE(report["device"]["name"].is_string());
  EXPECT_GT(report["timings"]["total"], 0);
  EXPECT_EQ(tool("build ball.ply -o b.rbvh --report build.json").code, 1) << "the report is there already";
  EXPECT_FALSE(exists("b.rbvh"));
}

TEST_F(Chain, AnInterruptLeavesNothing) {
  const ToolRun run =
      shell("timeout --preserve-status -s INT 2 '" RBVH_TOOL
            "' render ball.ply -o '{frame}.png' --turntable 500 --samples 256 --resolution 2000,2000");
  EXPECT_EQ(run.code, 130) << run.err;
  EXPECT_EQ(files().find("tmp"), std::string::npos) << files();
}

TEST_F(Chain, ARawCloudIsSeenWithoutIngest) {
  std::string points;
  for (int i = 0; i < 60; ++i)
    for (int j = 0; j < 60; ++j) {
      char line[64];
      std::snprintf(line, sizeof line, "%g %g %g\n", 0.1 * i, 0.1 * j, 0.3 * std::sin(0.2 * i));
      points += line;
    }
  write("cloud.xyz", points);
  good("render cloud.xyz -o cloud.exr --aov depth --resolution 64,64");
  const Picture p = picture("cloud.exr");
  EXPECT_TRUE(std::isfinite(*p.at(32, 32)));
  const ToolRun run = tool("build cloud.xyz -o cloud.rbvh");
  EXPECT_EQ(run.code, 3);
  EXPECT_NE(run.err.find("ingest"), std::string::npos);
}

TEST_F(Chain, ScansWithoutAnExtentAreRefused) {
  write("nan.xyz", "nan nan nan\nnan 1 2\n");
  write("same.xyz", "1 2 3\n1 2 3\n1 2 3\n");
  for (const char* name : {"nan.xyz", "same.xyz"}) {
    const ToolRun run = tool(std::string("render -o x.png ") + name);
    EXPECT_EQ(run.code, 3) << name << run.err;
    EXPECT_EQ(run.lines(), 1) << run.err;
    EXPECT_FALSE(exists("x.png"));
  }
}

}  // namespace
}  // namespace rbvh
