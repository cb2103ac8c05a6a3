// Gaussian splats: as PLY files have them, against discs worked out by hand.
#include "pipeline/scan/splats.h"

#include <gtest/gtest.h>

#include <cmath>

#include "io/scan_io.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {

constexpr const char* kProperties[] = {"x",       "y",       "z",      "nx",       "ny",      "nz",
                                       "f_dc_0",  "f_dc_1",  "f_dc_2", "f_rest_0", "opacity", "scale_0",
                                       "scale_1", "scale_2", "rot_0",  "rot_1",    "rot_2",   "rot_3"};

struct Splat {
  Vec3d at;
  std::array<double, 3> color{0, 0, 0}, deviations{1, 1, 1};
  std::array<double, 4> rotation{1, 0, 0, 0};
  double opacity = 0.9;
};

std::string ply(const std::vector<Splat>& splats, const std::string& less = {}) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(splats.size()) + "\n";
  for (const char* name : kProperties)
    text += "property float " + std::string(name == less ? "other" : name) + "\n";
  text += "end_header\n";
  for (const Splat& s : splats) {
    const double values[] = {s.at.x,
                             s.at.y,
                             s.at.z,
                             0,
                             0,
                             0,
                             s.color[0],
                             s.color[1],
                             s.color[2],
                             0.25,
                             std::log(s.opacity / (1 - s.opacity)),
                             std::log(s.deviations[0]),
                             std::log(s.deviations[1]),
                             std::log(s.deviations[2]),
                             s.rotation[0],
                             s.rotation[1],
                             s.rotation[2],
                             s.rotation[3]};
    for (const double value : values) text += std::to_string(value) + " ";
    text += "\n";
  }
  return text;
}

TEST(Splats, BecomeDiscs) {
  const double half = std::sqrt(0.5);
  const RawScan scan =
      parse_scan(ply({{.at = {5, 0, 0}, .color = {2, 0, -2}, .deviations = {0.01, 0.2, 0.8}},  // thin along x
                      {.at = {-5, 0, 0},
                       .deviations = {0.01, 0.5, 0.5},
                       .rotation = {2, 0, 0, 0}},  // not a unit quaternion
                      {.at = {0, 7, 0},
                       .deviations = {0.01, 0.5, 0.5},
                       .rotation = {half, 0, 0, half}},  // x turned to y
                      {.at = {0, 0, 3}, .opacity = 0.2},
                      {.at = {0, 0, -3}, .rotation = {0, 0, 0, 0}}}),
                 "a.ply");
  ASSERT_EQ(scan.positions.size(), 3u);
  EXPECT_TRUE(scan.properties.empty());
  EXPECT_NEAR(scan.radii[0], 1.5 * std::sqrt(0.2 * 0.8), 1e-5);
  EXPECT_EQ(scan.colors[0], (Color8{255, 128, 0}));
  EXPECT_NEAR(scan.normals[0].x, 1, 1e-6);
  EXPECT_NEAR(scan.normals[1].x, -1, 1e-6) << "away from the middle";
  EXPECT_NEAR(scan.normals[2].y, 1, 1e-6);
  ASSERT_EQ(scan.notes.size(), 1u);
  EXPECT_NE(scan.notes[0].find("1 of 5 are below half opacity"), std::string::npos) << scan.notes[0];
  EXPECT_NE(scan.notes[0].find("1 splat without"), std::string::npos) << scan.notes[0];
}

TEST(Splats, OnlyWhereAllIsThere) {
  for (const char* less : {"opacity", "f_dc_1", "scale_2", "rot_3"}) {
    const RawScan scan = parse_scan(ply({{.at = {1, 2, 3}}, {.at = {4, 5, 6}}}, less), "a.ply");
    EXPECT_EQ(scan.positions.size(), 2u) << less;
    EXPECT_FALSE(scan.properties.empty()) << less;
  }
}

TEST(Splats, NoneOpaqueIsAnError) {
  EXPECT_THROW(parse_scan(ply({{.at = {1, 2, 3}, .opacity = 0.1}}), "a.ply"), Error);
}

}  // namespace
}  // namespace rbvh
