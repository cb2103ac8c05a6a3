// From where an object is seen: named views, the best one, the sensor's.
#include "rbvh/view.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/device/device.h"
#include "pipeline/light/soft_look.h"
#include "pipeline/trace/trace_fronts.h"
#include "rbvh/asset.h"
#include "rbvh/error.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

/// A cloud of points on a grid, whose discs face `towards` it.
Scan cloud_of(int n, Vec3f towards, const std::function<Vec3f(float s, float t)>& place) {
  Scan scan;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const Vec3f p = place((static_cast<float>(i) + 0.5f) / static_cast<float>(n),
                            (static_cast<float>(j) + 0.5f) / static_cast<float>(n));
      scan.positions.push_back(p);
      scan.normals.push_back(normalized(towards - p));
      scan.radii.push_back(0.04f);
    }
  return scan;
}

struct Subject {
  Device device = Device::open();
  Asset asset;
  std::unique_ptr<Tracer> tracer;
  explicit Subject(Scan&& scan) : asset(make_asset(std::move(scan))), tracer(make_tracer(device, asset)) {}

  PlacedCameras placed(const CameraRequest& request = {}) const {
    return place_cameras(*tracer, asset, request);
  }
  Vec3d direction(const CameraRequest& request = {}) const {
    const Camera camera = placed(request).cameras.at(0);
    return normalized(camera.position - camera.focal_point);
  }
};

void expect_near(Vec3d a, Vec3d b, double off = 1e-9) {
  EXPECT_LT(length(a - b), off) << a.x << " " << a.y << " " << a.z;
}

TEST(View, NamedViewsLookAlongTheAxes) {
  const Subject ball(bumpy_sphere(24));
  const std::pair<const char*, Vec3d> views[] = {{"front", {0, 0, 1}}, {"back", {0, 0, -1}},
                                                 {"left", {-1, 0, 0}}, {"right", {1, 0, 0}},
                                                 {"top", {0, 1, 0}},   {"bottom", {0, -1, 0}}};
  for (const auto& [name, from] : views) {
    ASSERT_TRUE(find_view(name)) << name;
    expect_near(ball.direction({.view = *find_view(name)}), from);
  }
  const Vec3d iso = ball.direction({.view = View::kIso});
  EXPECT_NEAR(iso.y, std::sqrt(1. / 3), 1e-9);
  EXPECT_NEAR(std::abs(iso.x), iso.z, 1e-9);
  EXPECT_FALSE(find_view("Front"));
  // With +Z up, the front is -Y.
  expect_near(ball.direction({.view = View::kTop, .up = Vec3d{0, 0, 1}}), {0, 0, 1});
  expect_near(ball.direction({.view = View::kFront, .up = Vec3d{0, 0, 1}}), {0, -1, 0});
}

TEST(View, WhatIsGivenIsUsed) {
  const Subject ball(bumpy_sphere(24));
  CameraWords words;
  words.position = Vec3d{0, 0, 9};
  PlacedCameras placed = ball.placed({.words = {words}});
  expect_near(placed.cameras[0].position, {0, 0, 9});
  EXPECT_EQ(placed.text, "");
  words = {};
  words.azimuth = 90;
  expect_near(ball.direction({.words = {words}}), {1, 0, 0});
  words.azimuth = 0;
  words.elevation = 30;
  EXPECT_NEAR(ball.direction({.words = {words}, .view = View::kBack}).y, 0.5, 1e-9);
  EXPECT_EQ(ball.placed({.words = {{}, {}}, .turns = 3}).cameras.size(), 6u);
}

/// A bowl, half a sphere, that opens towards `axis`: from behind only backs are seen.
Scan bowl(Vec3f axis) {
  Scan scan;
  Vec3f x{1, 0, 0};
  if (std::abs(axis.x) > 0.5f) x = {0, 1, 0};
  const Vec3f y = cross(axis, x);
  add_sheet(scan, 32, [&](float s, float t) {
    const float phi = 6.2831853f * s, theta = 1.5f * t;
    return x * (std::sin(theta) * std::cos(phi)) + y * (std::sin(theta) * std::sin(phi)) -
           axis * std::cos(theta);
  });
  return scan;
}

TEST(View, TheBestOneSeesFronts) {
  for (const Vec3f axis : {Vec3f{0, 0, 1}, Vec3f{0, 0, -1}, Vec3f{1, 0, 0}, Vec3f{-1, 0, 0}}) {
    Scan scan = bowl(axis);
    const Subject subject(std::move(scan));
    const Hit middle = intersect(
        *subject.tracer,
        std::vector<Ray>{{{axis.x * 3, axis.y * 3, axis.z * 3}, 0, {-axis.x, -axis.y, -axis.z}, 100}})[0];
    ASSERT_NE(middle.leaf, RBVH_NO_LEAF);
    const double side = (middle.flags & RBVH_HIT_BACK_FACE) == 0 ? 1 : -1;
    EXPECT_GT(dot(subject.direction(), static_cast<Vec3d>(axis)) * side, 0.4) << axis.x << " " << axis.z;
    EXPECT_NE(subject.placed().text.find("best of 20"), std::string::npos);
    EXPECT_EQ(subject.placed().text, subject.placed().text);
  }
}

TEST(View, ASensorAtTheOriginIsFoundByWhatItSees) {
  // In a camera's frame: y down, z forward; the wall waves.
  const auto wall = [](float s, float t) { return Vec3f{2 * s - 1, 2 * t - 1, 3 + 0.2f * std::sin(9 * s)}; };
  const Subject seen(cloud_of(60, {0, 0, 0}, wall));
  const PlacedCameras placed = seen.placed();
  EXPECT_NE(placed.text.find("the sensor's view"), std::string::npos) << placed.text;
  expect_near(placed.cameras[0].position, {0, 0, 0});
  EXPECT_LT(placed.cameras[0].up.y, -0.9);
  // All of it is in the picture, and it fills the frame.
  const std::vector<Hit> hits = intersect(*seen.tracer, camera_rays(placed.cameras[0], 64, 64));
  const auto count =
      std::count_if(hits.begin(), hits.end(), [](const Hit& hit) { return hit.leaf != RBVH_NO_LEAF; });
  EXPECT_GT(count, 64 * 64 * 8 / 10);
  // Normals that face away, or a surface all around, are not seen so.
  const Subject away(cloud_of(60, {0, 0, 9}, wall));
  EXPECT_EQ(away.placed().text.find("the sensor's view"), std::string::npos) << away.placed().text;
  EXPECT_THROW(away.placed({.view = View::kSensor}), Error);
  const Subject around(cloud_of(90, {0, 0, 0}, [](float s, float t) {
    const float phi = 6.2831853f * s, theta = 3.14159265f * t;
    return Vec3f{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
  }));
  EXPECT_EQ(around.placed().text.find("the sensor's view"), std::string::npos);
}

TEST(View, AViewpointThatAFileNamesIsBelieved) {
  Scan scan = cloud_of(60, {5, 0, 0}, [](float s, float t) { return Vec3f{0.1f * s, 2 * s - 1, 2 * t - 1}; });
  scan.viewpoints = {{.position = {5, 0, 0}}};
  const Subject subject(std::move(scan));
  const PlacedCameras placed = subject.placed();
  expect_near(placed.cameras[0].position, {5, 0, 0});
  EXPECT_GT(placed.cameras[0].up.z, 0.99);
}

TEST(View, UpIsAcrossTheLargestLevelPlane) {
  // A floor across y, with a wall on it.
  const Subject floor(cloud_of(80, {0, 1e6f, 0}, [](float s, float t) {
    return s < 0.8f ? Vec3f{3 * s - 1.2f, 0, 3 * t - 1.5f} : Vec3f{-1.2f, 4 * (s - 0.8f), 3 * t - 1.5f};
  }));
  const PlacedCameras placed = floor.placed();
  expect_near(placed.up, {0, 1, 0});
  EXPECT_NE(placed.text.find("+Y is up"), std::string::npos) << placed.text;
  expect_near(floor.placed({.up = Vec3d{0, 0, 1}}).up, {0, 0, 1});
}

TEST(View, FrontTracersSeeNoBacks) {
  Scan scan;
  add_plate(scan, 4, 1, false);
  add_plate(scan, 4, 0, true);
  Device device = Device::open();
  const Asset asset = make_asset(std::move(scan));
  const auto tracer = make_front_tracer(make_tracer(device, asset));
  const Ray down{{0.1f, 0.1f, 5}, 0, {0, 0, -1}, 100}, up{{0.1f, 0.1f, -5}, 0, {0, 0, 1}, 100};
  const std::vector<Hit> hits = intersect(*tracer, std::vector<Ray>{down, up});
  EXPECT_FLOAT_EQ(hits[0].t, 5);
  EXPECT_FLOAT_EQ(hits[1].t, 6);
  const auto blocked = occluded(*tracer, std::vector<Ray>{{{0.1f, 0.1f, 5}, 0, {0, 0, -1}, 4.5f}, down});
  EXPECT_EQ(blocked, (std::vector<std::uint8_t>{0, 1}));
  const Camera camera{{0, 0, 5}, {0, 0, 0}, {0, 1, 0}, 5};
  for (const Hit& hit : intersect(*tracer, camera_rays(camera, 16, 16))) EXPECT_NEAR(hit.t, 5, 0.1);
}

TEST(SoftLook, ShadowsAreCastAndRepeat) {
  // A plate over a larger one: what is below is darker than beside it.
  Scan scan;
  add_sheet(scan, 8, [](float s, float t) { return Vec3f{6 * s - 3, 6 * t - 3, 0}; });
  const Subject alone(Scan{scan});
  add_plate(scan, 2, 0.4f);
  const Subject both(std::move(scan));
  const Camera camera{{0, 0, 12}, {0, 0, 0}, {0, 1, 0}, 30};
  RenderConfig config;
  config.width = config.height = 64;
  config.up = {0, 0, 1};
  const auto draw = [&](const Subject& of) {
    RenderTimings timings;
    return render_soft(*of.tracer, *of.tracer, camera, config, {.offset = 0, .reach = 2, .outlines = false},
                       timings);
  };
  const Image plain = draw(alone), shadowed = draw(both);
  EXPECT_EQ(shadowed.pixels, draw(both).pixels);
  std::size_t darker = 0;
  for (std::size_t i = 0; i < plain.pixels.size(); i += 4)
    darker += shadowed.pixels[i] < 0.8f * plain.pixels[i];
  EXPECT_GT(darker, 30u);
  EXPECT_LT(darker, 800u);
  // Nothing stands over the plain one: what quick pictures show, but for no cut at 1.
  const Image quick = render(*alone.tracer, camera, config);
  for (std::size_t i = 0; i < plain.pixels.size(); i += 4) {
    if (quick.pixels[i + 3] < 1 || plain.pixels[i + 3] < 0.999f) continue;
    EXPECT_NEAR(plain.pixels[i], 1.3f * quick.pixels[i], 0.03f) << i;
  }
}

}  // namespace
}  // namespace rbvh
