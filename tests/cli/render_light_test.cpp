// Pictures by paths, from the command line.
#include <nlohmann/json.hpp>

#include "tests/picture.h"
#include "tests/run_tool.h"

namespace rbvh {
namespace {

class Light : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("ball.ply", ball_ply(24));
    good("build ball.ply -o ball.rbvh --levels Q0,Q3");
  }
  /// Renders ball.rbvh at 32 x 32 and 4 samples.
  Picture lit(const std::string& words, const std::string& file = "a.png") const {
    good("render ball.rbvh -f --resolution 32,32 --samples 4 -o " + file + " " + words);
    return read_picture(path(file));
  }
};

TEST_F(Light, NamedLightsDifferAndRepeat) {
  std::vector<Picture> pictures;
  for (const char* light : {"studio", "headlight", "sky", "sun", "white"}) {
    pictures.push_back(lit(std::string("--light ") + light));
    EXPECT_EQ(pictures.back().channels, 4);
    EXPECT_EQ(pictures.back().pixels, lit(std::string("--light ") + light).pixels) << light;
    for (std::size_t i = 0; i + 1 < pictures.size(); ++i)
      EXPECT_NE(pictures[i].pixels, pictures.back().pixels) << light;
  }
}

TEST_F(Light, OptionsChangeThePicture) {
  const Picture plain = lit("--light sky");
  for (const char* words :
       {"--sun-direction 200,20", "--material glossy:0.1", "--material metal", "--material glass:1.3",
        "--ground", "--bounces 1", "--bounce-level Q3", "--denoise", "--linear", "--seed 7"})
    EXPECT_NE(lit(std::string("--light sky ") + words).pixels, plain.pixels) << words;
  EXPECT_EQ(lit("--light sky --material matte").pixels, plain.pixels);
}

TEST_F(Light, ReportsSamplesAndNoiseAndStopsInTime) {
  good("render ball.rbvh -f --resolution 32,32 --light studio --samples 16 -o a.png --report r.json");
  auto report = nlohmann::json::parse(read("r.json"));
  EXPECT_EQ(report["paths"]["samples"], 16);
  EXPECT_GT(report["paths"]["noise"], 0);
  EXPECT_GT(report["counts"]["rays"], 16 * 32 * 32);
  good(
      "render ball.rbvh -f --resolution 32,32 --light studio --samples 1000000 --time 0.2s -o a.png -f "
      "--report r.json");
  report = nlohmann::json::parse(read("r.json"));
  EXPECT_LT(report["paths"]["samples"], 1000000);
}

TEST_F(Light, SaysThatAScanHasNoLevelsForBounces) {
  const ToolRun run =
      tool("render ball.ply --light white --bounce-level Q3 --resolution 8,8 --samples 1 -o a.png");
  EXPECT_EQ(run.code, 0);
  EXPECT_NE(run.err.find("has no levels; --bounce-level is ignored"), std::string::npos) << run.err;
}

TEST_F(Light, AMapLightsAsItIs) {
  // A picture is a map as well: the ball's, on black.
  good("render ball.rbvh -o map.exr --resolution 64,32 --camera-view-angle 20");
  EXPECT_NE(lit("--light map.exr").pixels, lit("--light white").pixels);
}

TEST_F(Light, AovsOfLight) {
  const std::pair<const char*, int> aovs[] = {
      {"ao", 1}, {"albedo", 3}, {"shadow", 1}, {"direct", 3}, {"indirect", 3}};
  for (const auto& [aov, channels] : aovs) {
    EXPECT_EQ(lit(std::string("--aov ") + aov, "a.exr").channels, channels) << aov;
    EXPECT_EQ(lit(std::string("--aov ") + aov).width, 32) << aov;
    EXPECT_EQ(lit(std::string("--aov ") + aov, "a.jpg").height, 32) << aov;
  }
  const Picture near = lit("--aov ao --ao-distance 1e-6", "a.exr");
  EXPECT_EQ(*std::min_element(near.pixels.begin(), near.pixels.end()), 1);
}

TEST_F(Light, WhatMakesNoSenseIsOneLine) {
  bad("render ball.ply -o x.png --light moon", 2, "'moon' is none of studio");
  bad("render ball.ply -o x.png --denoise", 2, "--denoise is for pictures with --light");
  bad("render ball.ply -o x.png --light sky --material jelly", 2, "'jelly' is none of matte");
  bad("render ball.ply -o x.png --light sky --material metal:2", 2, "--material");
  bad("render ball.ply -o x.png --light sky --sun-direction 3", 2, "not two angles");
  bad("render ball.ply -o x.png --light sky --sun-direction 3,2", 2, "--sun-direction");
  bad("render ball.rbvh -o x.png --light sky --bounce-level Q9", 2, "no level 'Q9'");
  bad("render ball.ply -o x.png --aov normal --light sky", 2, "--light");
  write("bad.exr", "\x76\x2f\x31\x01 and no more");
  bad("render ball.ply -o x.png --light bad.exr", 3, "bad.exr: ");
  write("bad.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4000 +X 8000\n");
  bad("render ball.ply -o x.png --light bad.hdr", 3, "bad.hdr: ");
  write("text.hdr", "hello");
  bad("render ball.ply -o x.png --light text.hdr", 3, "neither an EXR nor a Radiance HDR");
}

}  // namespace
}  // namespace rbvh
