// What pictures look like: each option changes what it says, or is refused.
#include <nlohmann/json.hpp>

#include "tests/picture.h"
#include "tests/run_tool.h"

namespace rbvh {
namespace {

class Look : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    // A ball, each vertex with its height as a property.
    write("ball.ply", ball_ply(16));
    write("tilt.ply",
          "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
          "property float height\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
          "-1 -1 0 0\n1 -1 0 0\n1 1 0 10\n-1 1 0 10\n3 0 1 2\n3 0 2 3\n");
  }
  Picture drawn(const std::string& words, const std::string& file = "ball.ply") const {
    good("render " + file + " -f --resolution 64,64 -o a.png " + words);
    return read_picture(path("a.png"));
  }
};

TEST_F(Look, OptionsChangeThePicture) {
  const Picture plain = drawn("");
  for (const char* words : {"--quick", "--view back", "--edges", "--background white", "--grid", "--axis",
                            "--label", "--linear", "--samples 2"})
    EXPECT_NE(drawn(words).pixels, plain.pixels) << words;
  EXPECT_EQ(drawn("").pixels, plain.pixels);
  EXPECT_EQ(drawn("--background transparent").pixels, plain.pixels);
  EXPECT_EQ(drawn("--hide-back --quick").pixels, drawn("--quick").pixels);
}

TEST_F(Look, BackgroundsAreBehind) {
  const Picture white = drawn("--background white"), blue = drawn("--background '#0000ff'"),
                own = drawn("--background 0,0,1");
  EXPECT_EQ(white.at(0, 0)[0], 1);
  EXPECT_EQ(white.at(0, 0)[3], 1);
  EXPECT_EQ(blue.at(0, 0)[0], 0);
  EXPECT_EQ(blue.at(0, 0)[2], 1);
  EXPECT_EQ(own.pixels, blue.pixels);
  EXPECT_EQ(white.at(32, 32)[0], blue.at(32, 32)[0]);
  bad("render ball.ply -o x.png --background pink", 2, "--background");
  bad("render ball.ply -o x.exr --aov depth --edges", 2, "--edges");
  bad("render ball.ply -o x.png --background 0,0,2", 2, "--background");
}

TEST_F(Look, VertexPropertiesAreColours) {
  const std::string words = "--view front --quick --color-layer height ";
  const auto differ = [&](const Picture& p) { return p.at(32, 8)[0] - p.at(32, 56)[0]; };
  EXPECT_GT(differ(drawn(words, "tilt.ply")), 0.1);
  const Picture viridis = drawn(words, "tilt.ply");
  EXPECT_NE(drawn(words + "--color-map turbo", "tilt.ply").pixels, viridis.pixels);
  EXPECT_NE(drawn(words + "--color-map cividis", "tilt.ply").pixels, viridis.pixels);
  EXPECT_NE(drawn(words + "--scalar-bar", "tilt.ply").pixels, viridis.pixels);
  EXPECT_NEAR(differ(drawn(words + "--range 100,200", "tilt.ply")), 0, 0.05);
  EXPECT_EQ(drawn(words + "--range 0,10", "tilt.ply").pixels, viridis.pixels);
  bad("render tilt.ply -o x.png --color-layer depth", 2, "depth");
  bad("render tilt.ply -o x.png --color-layer height --range 2,1", 2, "--range");
  bad("render tilt.ply -o x.png --range 0,1", 2, "--color-layer");
}

TEST_F(Look, BacksAreHidden) {
  EXPECT_GT(drawn("--view back --quick", "tilt.ply").at(32, 32)[3], 0.9);
  EXPECT_EQ(drawn("--view back --quick --hide-back --background white", "tilt.ply").at(32, 32)[0], 1);
}

TEST_F(Look, TheViewIsSaid) {
  ToolRun run = tool("render ball.ply -o a.png --resolution 32,32 --report r.json");
  EXPECT_EQ(run.code, 0);
  EXPECT_NE(run.err.find("ball.ply: best of 20 views: azimuth"), std::string::npos) << run.err;
  const auto report = nlohmann::json::parse(read("r.json"));
  EXPECT_NE(report["views"][0]["view"].get<std::string>().find("azimuth"), std::string::npos);
  bad("render ball.ply -o x.png --view side", 2, "--view");
  bad("render ball.ply -o x.png --view left --camera-position 0,0,9", 2, "--camera-position");
  bad("render ball.ply -o x.png --view sensor", 2, "seen from one place");
}

TEST_F(Look, SheetsAndFilms) {
  good("render ball.ply tilt.ply -o sheet.png --sheet 2x1 --resolution 32,24 --quick");
  const Picture sheet = read_picture(path("sheet.png"));
  EXPECT_EQ(sheet.width, 64);
  EXPECT_EQ(sheet.height, 24);
  EXPECT_GT(sheet.at(16, 12)[3], 0.9);
  EXPECT_GT(sheet.at(48, 12)[3], 0.9);
  bad("render ball.ply tilt.ply -o x.png --sheet 1x1 --resolution 8,8", 2, "room for 1 picture");
  bad("render ball.ply -o x.png --sheet 3", 2, "--sheet");
  good("render ball.ply -o turn.gif --turntable 5 --resolution 32,32 --quick");
  const auto in = OIIO::ImageInput::open(path("turn.gif"));
  ASSERT_TRUE(in);
  int frames = 0;
  while (in->seek_subimage(frames, 0)) ++frames;
  EXPECT_EQ(frames, 5);
  bad("render ball.ply -o x.gif --sheet 1x1", 2, "gif");
}

TEST_F(Look, WithoutAFontTheLabelIsMissed) {
  const ToolRun run = tool("render ball.ply -o a.png --resolution 32,32 --label --font-file /none.ttf");
  EXPECT_EQ(run.code, 0);
  EXPECT_NE(run.err.find("--font-file"), std::string::npos) << run.err;
}

TEST_F(Look, WhatOcclusionHasNoUseForIsRefused) {
  good("build ball.ply -o ball.rbvh --levels Q4");
  for (const char* words : {"--time 1", "--denoise", "--material clay", "--ground", "--bounces 2",
                            "--light sky", "--sun-direction 0,45", "--linear"})
    bad(std::string("render ball.ply -o x.png --aov ao ") + words, 2, "ao");
  for (const char* words :
       {"--material clay", "--ground", "--bounces 2", "--light sky", "--sun-direction 0,45"})
    bad(std::string("bake ball.rbvh -o x.rbvh --layer ao ") + words, 2, "ao");
  bad("bake ball.rbvh -o x.rbvh --layer sky --bounces 3", 2, "--bounces");
  bad("bake ball.rbvh -o x.rbvh --layer sky --ao-distance 3", 2, "--ao-distance");
}

}  // namespace
}  // namespace rbvh
