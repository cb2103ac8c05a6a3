#include "rbvh/camera.h"

#include <gtest/gtest.h>
#include <optional>

#include "pipeline/base/error.h"
#include "pipeline/trace/camera_rays.h"

namespace rbvh {
namespace {

constexpr Vec3d kUpY{0, 1, 0}, kUpZ{0, 0, 1};
const Bounds3d kBox{{-1, -2, -3}, {1, 2, 3}};

void expect_near(Vec3d a, Vec3d b, double tolerance = 1e-9) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

// Where a point falls in the image, in pixels from the top left corner, by plain trigonometry.
struct Pixel {
  double x, y;
};
Pixel project(const Camera& camera, Vec3d p, double width, double height) {
  const Vec3d forward = normalized(camera.focal_point - camera.position);
  const Vec3d right = normalized(cross(forward, camera.up));
  const Vec3d d = p - camera.position;
  const double scale = height / 2 / std::tan(camera.view_angle * M_PI / 360) / dot(d, forward);
  return {width / 2 + dot(d, right) * scale, height / 2 - dot(d, camera.up) * scale};
}

std::vector<Vec3d> corners(const Bounds3d& box) {
  std::vector<Vec3d> points;
  for (const double x : {box.lo.x, box.hi.x})
    for (const double y : {box.lo.y, box.hi.y})
      for (const double z : {box.lo.z, box.hi.z}) points.push_back({x, y, z});
  return points;
}

CameraWords placed(Vec3d position, Vec3d focal_point, Vec3d view_up) {
  CameraWords words;
  words.position = position;
  words.focal_point = focal_point;
  words.view_up = view_up;
  return words;
}

TEST(Camera, GivenWordsAreUsedUnchanged) {
  CameraWords words = placed({5, 1, 2}, {0.5, 1, 2}, {0, 0, 2});
  words.view_angle = 45;
  const Camera camera = place_camera(words, kBox, kUpY, 2);
  expect_near(camera.position, {5, 1, 2});
  expect_near(camera.focal_point, {0.5, 1, 2});
  expect_near(camera.up, {0, 0, 1});
  EXPECT_EQ(camera.view_angle, 45);
}

TEST(Camera, DefaultShowsTheWholeObjectAndTouchesTheFrame) {
  for (const Vec3d up : {kUpY, kUpZ, Vec3d{-1, 0, 0}})
    for (const double aspect : {0.5, 1.0, 1.78}) {
      const double height = 1000, width = height * aspect;
      const Camera camera = place_camera({}, kBox, up, aspect);
      Bounds3d picture;
      for (const Vec3d corner : corners(kBox)) {
        const Pixel p = project(camera, corner, width, height);
        picture.add(Vec3d{p.x, p.y, 0});
      }
      EXPECT_GE(picture.lo.x, 0);
      EXPECT_GE(picture.lo.y, 0);
      EXPECT_LE(picture.hi.x, width);
      EXPECT_LE(picture.hi.y, height);
      const double filled =
          std::max((picture.hi.x - picture.lo.x) / width, (picture.hi.y - picture.lo.y) / height);
      EXPECT_GT(filled, 0.9);
      expect_near(picture.center(), {width / 2, height / 2, 0}, 1e-6 * height);
      EXPECT_GT(dot(camera.up, up), 0.5);
    }
}

TEST(Camera, ZeroAnglesLookFromTheFront) {
  CameraWords words;
  words.azimuth = 0;
  const Camera mesh = place_camera(words, kBox, kUpY, 1);
  expect_near(normalized(mesh.position - mesh.focal_point), {0, 0, 1});
  const Camera cloud = place_camera(words, kBox, kUpZ, 1);
  expect_near(normalized(cloud.position - cloud.focal_point), {0, -1, 0});
}

TEST(Camera, AzimuthGoesRightAndElevationUp) {
  CameraWords words = placed({0, 0, 10}, {0, 0, 0}, kUpY);
  words.azimuth = 90;
  expect_near(place_camera(words, kBox, kUpY, 1).position, {10, 0, 0});
  words.azimuth = 0;
  words.elevation = 30;
  expect_near(place_camera(words, kBox, kUpY, 1).position, {0, 5, 10 * std::cos(M_PI / 6)});
  words.elevation = 90;  // straight from above, where the view up alone would not do
  const Camera above = place_camera(words, kBox, kUpY, 1);
  expect_near(above.position, {0, 10, 0});
  expect_near(above.up, {0, 0, -1});
}

TEST(Camera, AzimuthComesBeforeElevation) {
  CameraWords words = placed({0, 0, 10}, {0, 0, 0}, kUpY);
  words.azimuth = 90;
  words.elevation = 30;
  expect_near(place_camera(words, kBox, kUpY, 1).position, {10 * std::cos(M_PI / 6), 5, 0});
}

TEST(Camera, DegenerateWordsAreRefused) {
  const auto code = [](const CameraWords& words) -> std::optional<ErrorKind> {
    try {
      place_camera(words, kBox, kUpY, 1);
    } catch (const Error& error) {
      return error.kind();
    }
    return std::nullopt;
  };
  EXPECT_EQ(code(placed({1, 2, 3}, {1, 2, 3}, kUpY)), ErrorKind::kUsage);
  EXPECT_EQ(code(placed({0, 9, 0}, {0, 0, 0}, kUpY)), ErrorKind::kUsage);
  EXPECT_EQ(code(placed({0, 0, 9}, {0, 0, 0}, {0, 0, 0})), ErrorKind::kUsage);
  for (const double angle : {0.0, -30.0, 180.0}) {
    CameraWords words;
    words.view_angle = angle;
    EXPECT_EQ(code(words), ErrorKind::kUsage) << angle;
  }
  EXPECT_EQ(code(placed({0, 0, 9}, {0, 0, 0}, kUpY)), std::nullopt);
}

TEST(Camera, APointStillGetsACamera) {
  const Camera camera = place_camera({}, {{1, 1, 1}, {1, 1, 1}}, kUpY, 1);
  EXPECT_GT(length(camera.position - camera.focal_point), 0);
}

TEST(Camera, RaysAreAsDocumented) {
  const Camera camera = place_camera(placed({0, 0, 10}, {0, 0, 0}, kUpY), kBox, kUpY, 2);
  const CameraRays rays = camera_rays(camera, 400, 200);
  const auto direction = [&](std::uint32_t x, std::uint32_t y) {
    return static_cast<Vec3d>(pixel_direction(rays, x, y));
  };
  // Pixel centres: the middle of the image lies between the four middle pixels.
  const Vec3d middle = direction(199, 99) + direction(200, 100) + direction(199, 100) + direction(200, 99);
  expect_near(normalized(middle), {0, 0, -1}, 1e-6);
  EXPECT_LT(direction(0, 0).x, 0);  // column 0 at the left
  EXPECT_GT(direction(0, 0).y, 0);  // row 0 on top
  // The vertical view angle runs from the upper edge of row 0 to the lower one of row 199.
  const double half_pixel = std::tan(15 * M_PI / 180) / 100 / 2;
  EXPECT_NEAR(direction(199, 0).y / -direction(199, 0).z, std::tan(15 * M_PI / 180) - half_pixel, 1e-6);
  EXPECT_NEAR(length(direction(0, 0)), 1, 1e-6);
}

TEST(Camera, ABandOfRowsIsTheSameCamera) {
  const Camera camera = place_camera({}, kBox, kUpY, 1);
  const CameraRays whole = camera_rays(camera, 64, 64), band = camera_rays(camera, 64, 64, 0.5, 0.5 + 40);
  EXPECT_EQ(pixel_direction(whole, 7, 45), pixel_direction(band, 7, 5));
}

TEST(Camera, TurntableGoesAroundAndStartsAtTheBase) {
  const Camera base = place_camera({}, kBox, kUpY, 1);
  const auto cameras = turntable(base, kUpY, 4);
  ASSERT_EQ(cameras.size(), 4u);
  expect_near(cameras[0].position, base.position);
  const Vec3d to0 = cameras[0].position - base.focal_point, to2 = cameras[2].position - base.focal_point;
  expect_near({to2.x, to2.y, to2.z}, {-to0.x, to0.y, -to0.z});
  for (const Camera& camera : cameras) {
    EXPECT_NEAR(camera.position.y, base.position.y, 1e-9);
    EXPECT_NEAR(dot(camera.up, camera.focal_point - camera.position), 0, 1e-9);
  }
}

TEST(Camera, ViewsAroundAllSeeTheWholeObject) {
  for (const Camera& camera : views_around(kBox, kUpZ, 8, 1))
    for (const Vec3d corner : corners(kBox)) {
      const Pixel p = project(camera, corner, 100, 100);
      EXPECT_TRUE(p.x >= 0 && p.x <= 100 && p.y >= 0 && p.y <= 100) << p.x << ' ' << p.y;
    }
}

}  // namespace
}  // namespace rbvh
