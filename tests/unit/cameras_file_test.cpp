// Camera files: what they mean, and each way in which they can be wrong.
#include "io/cameras_file.h"

#include <gtest/gtest.h>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

TEST(CamerasFile, WhatACameraDoesNotSayIsTheDefault) {
  CameraWords defaults;
  defaults.view_angle = 40;
  const std::string list = R"([{"position": [1, 2, 3], "azimuth_angle": 5}, {"view_angle": 20}])";
  for (const std::string& text : {list, R"({"cameras": )" + list + "}"}) {
    const std::vector<CameraWords> cameras = decode_cameras(text, "c.json", defaults);
    ASSERT_EQ(cameras.size(), 2u);
    EXPECT_EQ(cameras[0].position, (Vec3d{1, 2, 3}));
    EXPECT_EQ(cameras[0].azimuth, 5);
    EXPECT_EQ(cameras[0].view_angle, 40);
    EXPECT_EQ(cameras[1].view_angle, 20);
    EXPECT_FALSE(cameras[1].position);
  }
}

TEST(CamerasFile, FaultsAreOneLineWithTheirPlace) {
  const std::pair<std::string, const char*> kWrong[] = {
      {"", "c.json: byte 1: "},
      {"[{}", "byte 4: "},
      {"[]", "a list of one camera or more"},
      {"{}", "a list of one camera or more"},
      {"[7]", "camera 0: an object"},
      {R"([{}, {"position": [0, 6]}])", "camera 1, position: three numbers"},
      {R"([{"view_angle": "30"}])", "camera 0, view_angle: a number"},
      {R"([{"view_angle": 1e999}])", "no JSON"},
      {R"([{"posi\u001b\ntion": 1}])", "camera 0, posi??tion: is no camera word"},
      {std::string(1'000'000, '['), "nests too deep"},
      {R"({"cameras": )" + std::string(1'000'000, '[') + std::string(1'000'000, ']') + "}", "nests too deep"},
  };
  for (const auto& [text, part] : kWrong) {
    try {
      decode_cameras(text, "c.json", {});
      ADD_FAILURE() << "taken: " << text.substr(0, 80);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what() << " lacks " << part;
    }
  }
}

}  // namespace
}  // namespace rbvh
