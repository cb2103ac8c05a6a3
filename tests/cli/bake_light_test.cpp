// Light baked into layers, from the command line, and pictures drawn with it.
#include <nlohmann/json.hpp>

#include <algorithm>

#include "tests/picture.h"
#include "tests/run_tool.h"

namespace rbvh {
namespace {

class Bake : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("ball.ply", ball_ply(24));
    good("build ball.ply -o ball.rbvh --levels Q3,Q4");
  }
};

TEST_F(Bake, OcclusionIsThatOfPicturesAndTheSkyLightsFromAbove) {
  good("bake ball.rbvh --layer ao --samples 16 -o ao.rbvh --report r.json");
  const auto report = nlohmann::json::parse(read("r.json"));
  EXPECT_EQ(report["levels"].size(), 2u);
  EXPECT_GT(report["counts"]["texels"], 100);
  good("render ao.rbvh --cached ao --linear --samples 1 --resolution 32,32 -o ao.exr");
  good("bake ao.rbvh --layer sky --light sky --samples 16 --level Q4 -o lit.rbvh --layer-scale 2");
  good("render lit.rbvh --level Q4 --cached sky --view front --resolution 32,32 -o lit.png");
  good("render lit.rbvh --cached ao --resolution 32,32 -o both.png");  // layers that were there stay
  const Picture open = read_picture(path("ao.exr")), lit = read_picture(path("lit.png"));
  // EXR has light as it is, also without being asked to.
  good("render ao.rbvh --cached ao --samples 1 --resolution 32,32 -o same.exr");
  EXPECT_EQ(read_picture(path("same.exr")).pixels, open.pixels);
  good("render ball.rbvh --aov ao --samples 64 --resolution 32,32 -o seen.exr");
  const Picture seen = read_picture(path("seen.exr"));
  double apart = 0, inside = 0;
  for (int i = 0; i < 32 * 32; ++i) {
    const float* p = open.at(i % 32, i / 32);
    if (p[3] < 1) continue;
    apart += std::abs(static_cast<double>(p[0] / 0.5f - seen.at(i % 32, i / 32)[0]));  // clay's red is 0.5
    ++inside;
  }
  EXPECT_LT(apart, 0.06 * inside);
  double above = 0, below = 0;
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 32; ++x) {
      above += static_cast<double>(lit.at(x, y)[0]);
      below += static_cast<double>(lit.at(x, 31 - y)[0]);
    }
  EXPECT_GT(above, 1.3 * below);
}

TEST_F(Bake, IrradianceIsThePathTracersLight) {
  good(
      "bake ball.rbvh --layer irradiance --light sun --sun-direction 20,60 --bounces 8 --samples 256 --seed "
      "3 -o lit.rbvh");
  good("render lit.rbvh --cached irradiance --linear --resolution 24,24 --samples 16 -o cached.exr");
  good(
      "render ball.rbvh --light sun --sun-direction 20,60 --bounces 8 --linear --resolution 24,24 --samples "
      "256 -o paths.exr");
  const Picture cached = read_picture(path("cached.exr")), paths = read_picture(path("paths.exr"));
  double difference = 0, mean = 0;
  for (int i = 0; i < 24 * 24; ++i) {
    difference += std::abs(static_cast<double>(cached.at(i % 24, i / 24)[1] - paths.at(i % 24, i / 24)[1]));
    mean += static_cast<double>(paths.at(i % 24, i / 24)[1]);
  }
  EXPECT_LT(difference, 0.08 * mean);
}

TEST_F(Bake, OptionsChangeTheLayer) {
  good("bake ball.rbvh --layer irradiance --samples 4 --layer-scale 0.25 -f -o a.rbvh");
  for (const char* words : {"--ground", "--material clay", "--seed 9"}) {
    good("bake ball.rbvh --layer irradiance --samples 4 --layer-scale 0.25 -f -o b.rbvh " +
         std::string(words));
    // Clay is what the ball is made of.
    EXPECT_EQ(read("a.atlas.tif") == read("b.atlas.tif"), std::string(words) == "--material clay") << words;
  }
  good("bake ball.rbvh --layer ao --layer-scale 0.25 --samples 4 -f -o c.rbvh");
  good("bake ball.rbvh --layer ao --layer-scale 0.25 --ao-distance 1e-6 --samples 4 -f -o d.rbvh");
  good("bake ball.rbvh --layer ao --layer-scale 0.25 --samples 4 -f -o e.rbvh");
  EXPECT_EQ(read("c.atlas.tif"), read("e.atlas.tif"));
}

TEST_F(Bake, WhatMakesNoSenseIsOneLine) {
  bad("bake ball.rbvh --layer shine -o x.rbvh", 2, "'shine' is none of ao, sky, irradiance");
  bad("bake ball.rbvh --layer sky --light studio -o x.rbvh", 2, "studio goes with a camera");
  bad("bake ball.ply --layer ao -o x.rbvh", 3, "ball.ply");
  bad("render ball.rbvh --cached ao -o x.png", 2, "no layer 'ao'");
  bad("render ball.rbvh --cached ao --aov depth -o x.exr", 2, "--cached is for shaded pictures");
  bad("render ball.rbvh --cached ao --aov ao -o x.png", 2, "--cached is for shaded pictures");
  bad("render ball.rbvh --cached ao --color-layer wear -o x.png", 2, "--cached is for shaded pictures");
  bad("render ball.ply --cached ao -o x.png", 2, "no layer 'ao'");
}

}  // namespace
}  // namespace rbvh
