// Pictures by paths against what is known of light.
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/device/device.h"
#include "pipeline/proxy/bake.h"
#include "pipeline/scan/complete_cloud.h"
#include "pipeline/scene/asset_content.h"
#include "rbvh/build.h"
#include "rbvh/light.h"
#include "tests/bench/vary_scan.h"
#include "tests/exact_scenes.h"
#include "tests/path_oracle.h"
#include "tests/property.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

const Device& device() {
  static const Device opened = Device::open();
  return opened;
}

Camera camera_at(Vec3d position) { return {position, {0, 0, 0}, {0, 1, 0}, 40}; }

PathConfig config_of(std::uint32_t side, int samples) {
  PathConfig config;
  config.width = config.height = side;
  config.samples = samples;
  return config;
}

float luminance_at(const Image& image, std::size_t pixel) {
  const float* p = &image.pixels[pixel * image.channels.size()];
  return 0.2126f * p[0] + 0.7152f * p[1] + 0.0722f * p[2];
}

TracerConfig config_of_level(const std::string& level) {
  TracerConfig config;
  config.level = level;
  return config;
}

// In a light that is the same from everywhere, a white surface cannot be seen: the white furnace.

// The brightness of the pixels that are seen: the mean, and the darkest.
struct Whiteness {
  double mean = 0, darkest = 2, brightest = 0;
  int pixels = 0;
};

Whiteness furnace(const Asset& asset, const std::string& level) {
  const auto tracer = make_tracer(device(), asset, config_of_level(level));
  PathConfig config = config_of(48, 32);
  config.material.color = Vec3f{1, 1, 1};
  config.offset = path_offset(asset, level, level);
  const PathPicture picture =
      trace_paths(*tracer, *tracer, camera_at({0.6, 0.9, 3.6}), uniform_environment({1, 1, 1}), config);
  Whiteness found;
  for (std::size_t i = 0; i < picture.color.pixels.size() / 4; ++i) {
    const float alpha = picture.color.pixels[4 * i + 3];
    if (alpha < 0.5f) continue;
    const double value = static_cast<double>(luminance_at(picture.color, i) / alpha);
    found.mean += value;
    found.darkest = std::min(found.darkest, value);
    found.brightest = std::max(found.brightest, value);
    ++found.pixels;
  }
  EXPECT_GT(found.pixels, 300);
  found.mean /= found.pixels;
  return found;
}

void expect_white(const Asset& asset, const std::string& level, const char* what) {
  const Whiteness found = furnace(asset, level);
  EXPECT_GT(found.darkest, 0.995) << what << " " << level;
  EXPECT_LT(found.brightest, 1.005) << what << " " << level;
}

TEST(WhiteFurnace, MeshesAndLevels) {
  const Scan mesh = bumpy_sphere(60, 0.15f);
  expect_white(make_asset(Scan(mesh)), "", "mesh");
  const Asset pair = build_pair(device(), mesh);
  for (const std::string& level : level_names(pair)) expect_white(pair, level, "pair");
}

TEST(WhiteFurnace, LevelsOfTiles) {
  BuildConfig config;
  config.levels = by_density(standard_levels({"Q0"}));
  const Asset pair = build_pair(device(), bumpy_sphere(120, 0.1f), config);
  expect_white(pair, "Q0", "tiles");
}

TEST(WhiteFurnace, Clouds) {
  Scan cloud = sample_points(bumpy_sphere(60, 0.15f), 20000, property_seed());
  cloud.normals.clear();
  complete_cloud(cloud, {});
  // Between its discs a path may slip inside, from where few come back.
  const Whiteness found = furnace(make_asset(std::move(cloud)), "");
  EXPECT_NEAR(found.mean, 1, 0.005);
  EXPECT_LE(found.brightest, 1.005);
}

TEST(PathTracer, ASphereUnderHalfASkyIsAsTheFormulaSays) {
  Environment environment;
  environment.sky = make_image(Image::Kind::kColor, 512, 256, {"R", "G", "B"});
  std::fill_n(environment.sky.pixels.begin(), environment.sky.pixels.size() / 2, 1.0f);
  const Asset sphere = make_asset(bumpy_sphere(160, 0));
  const auto tracer = make_tracer(device(), sphere);
  PathConfig config = config_of(32, 256);
  config.material.color = Vec3f{0.5f, 0.5f, 0.5f};
  const Camera camera = camera_at({0, 0, 4});
  const PathPicture picture = trace_paths(*tracer, *tracer, camera, environment, config);
  const CameraRays rays = camera_rays(camera, 32, 32);
  const std::vector<Hit> hits = intersect(*tracer, rays);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    if (picture.color.pixels[4 * i + 3] < 1) continue;
    // Of a tilted plane: the part of its hemisphere that is above the horizon, by cosine.
    const float expected = 0.5f * (1 + hits[i].normal[1]) / 2;
    EXPECT_NEAR(luminance_at(picture.color, i), expected, 0.012f) << i;
  }
}

// --- against brute force
// ------------------------------------------------------------------------------------

void add_quad(Scan& scan, Vec3f a, Vec3f b, Vec3f c, Vec3f d) {
  const auto first = static_cast<std::uint32_t>(scan.positions.size());
  const Vec3f n = normalized(cross(b - a, c - a));
  for (const Vec3f& p : {a, b, c, d}) {
    scan.positions.push_back(p);
    scan.normals.push_back(n);
  }
  scan.triangles.push_back({first, first + 1, first + 2});
  scan.triangles.push_back({first, first + 2, first + 3});
}

// A floor and a wall that see each other.
Scan corner() {
  Scan scan;
  add_quad(scan, {-1, -0.6f, -0.6f}, {-1, -0.6f, 1}, {1, -0.6f, 1}, {1, -0.6f, -0.6f});
  add_quad(scan, {-1, -0.6f, -0.6f}, {1, -0.6f, -0.6f}, {1, 0.8f, -0.8f}, {-1, 0.8f, -0.8f});
  return scan;
}

Scan box() {
  Scan scan;
  const float a = 0.7f;
  add_quad(scan, {-a, -a, a}, {a, -a, a}, {a, a, a}, {-a, a, a});
  add_quad(scan, {a, -a, -a}, {-a, -a, -a}, {-a, a, -a}, {a, a, -a});
  add_quad(scan, {a, -a, a}, {a, -a, -a}, {a, a, -a}, {a, a, a});
  add_quad(scan, {-a, -a, -a}, {-a, -a, a}, {-a, a, a}, {-a, a, -a});
  add_quad(scan, {-a, a, a}, {a, a, a}, {a, a, -a}, {-a, a, -a});
  add_quad(scan, {-a, -a, -a}, {a, -a, -a}, {a, -a, a}, {-a, -a, a});
  return scan;
}

void compare_with_brute_force(Scan scan, oracle::LitScene lit, const Material& material, const char* what) {
  constexpr std::uint32_t kSide = 6;
  constexpr int kSamples = 512, kPaths = 12000;
  for (const auto& t : scan.triangles)
    lit.triangles.push_back(
        {point(scan.positions[t[0]]), point(scan.positions[t[1]]), point(scan.positions[t[2]])});
  Environment environment = uniform_environment({1, 1, 1});
  for (float& value : environment.sky.pixels) value = static_cast<float>(lit.sky);
  const float sun_radiance = static_cast<float>(lit.sun_radiance);
  environment.sun = {
      {static_cast<float>(lit.sun[0]), static_cast<float>(lit.sun[1]), static_cast<float>(lit.sun[2])},
      {sun_radiance, sun_radiance, sun_radiance},
      static_cast<float>(std::acos(lit.sun_cos))};
  const Asset asset = make_asset(std::move(scan));
  const auto tracer = make_tracer(device(), asset);
  const Camera camera = camera_at({0.5, 0.8, 3});
  PathConfig config = config_of(kSide, kSamples);
  config.material = material;
  const PathPicture picture = trace_paths(*tracer, *tracer, camera, environment, config);

  const CameraRays rays = camera_rays(camera, kSide, kSide, 0, 0);
  oracle::LitPaths paths(lit, property_seed());
  for (std::uint32_t pixel = 0; pixel < kSide * kSide; ++pixel) {
    double sum = 0, squares = 0;
    int seen = 0;
    for (int k = 0; k < kPaths; ++k) {
      const double x = pixel % kSide + paths.even(), y = pixel / kSide + paths.even();
      oracle::Point d{};
      for (std::size_t axis = 0; axis < 3; ++axis)
        d[axis] = static_cast<double>(rays.corner[axis]) + static_cast<double>(rays.right[axis]) * x +
                  static_cast<double>(rays.up[axis]) * y;
      d = oracle::unit(d);
      const oracle::Point o{camera.position.x, camera.position.y, camera.position.z};
      bool hits = false;
      for (const auto& [a, b, c] : lit.triangles) {
        const oracle::Meeting m = oracle::intersect_triangle(a, b, c, o, d);
        hits = hits || (m.crosses && m.inside >= 0 && m.t > 0);
      }
      const double value = hits ? paths.trace(o, d) : 0;  // the picture's background is transparent
      seen += hits ? 1 : 0;
      sum += value;
      squares += value * value;
    }
    if (seen == 0) continue;
    const double mean = sum / kPaths,
                 sigma = std::sqrt(std::max(0., squares / kPaths - mean * mean) / kPaths);
    EXPECT_NEAR(static_cast<double>(luminance_at(picture.color, pixel)), mean,
                5 * sigma + 0.015 * mean + 0.002)
        << what << ", pixel " << pixel;
  }
}

TEST(PathTracer, IsBruteForceFasterMatteGlossyAndMetal) {
  oracle::LitScene lit;
  lit.albedo = 0.8;
  lit.sky = 0.3;
  lit.sun = oracle::unit({0.4, 0.8, 0.6});
  lit.sun_cos = std::cos(0.4);
  lit.sun_radiance = 4;
  const Vec3f gray{0.8f, 0.8f, 0.8f};
  using Kind = oracle::LitScene::Kind;
  const std::pair<Kind, Material> kinds[] = {{Kind::kMatte, {Material::Kind::kMatte, 0, 1.5f, gray}},
                                             {Kind::kGlossy, {Material::Kind::kGlossy, 0.5f, 1.5f, gray}},
                                             {Kind::kMetal, {Material::Kind::kMetal, 0.5f, 1.5f, gray}}};
  for (const auto& [kind, material] : kinds) {
    lit.kind = kind;
    compare_with_brute_force(corner(), lit, material, std::to_string(static_cast<int>(kind)).c_str());
  }
}

TEST(PathTracer, IsBruteForceFasterThroughGlass) {
  oracle::LitScene lit;
  lit.kind = oracle::LitScene::Kind::kGlass;
  lit.sky = 0.3;
  lit.sun = oracle::unit({0.2, 0.5, -0.9});
  lit.sun_cos = std::cos(0.7);
  lit.sun_radiance = 3;
  compare_with_brute_force(box(), lit, {Material::Kind::kGlass, 0, 1.5f, Vec3f{1, 1, 1}}, "glass");
}

// --- noise
// --------------------------------------------------------------------------------------------------

double rms(const Image& a, const Image& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const double d = static_cast<double>(a.pixels[i] - b.pixels[i]);
    sum += d * d;
  }
  return std::sqrt(sum / static_cast<double>(a.pixels.size()));
}

PathPicture picture_of(const Tracer& tracer, int samples, std::uint32_t seed, bool denoise = false,
                       std::uint32_t side = 24) {
  PathConfig config = config_of(side, samples);
  config.seed = seed;
  config.denoise = denoise;
  const Camera camera = camera_at({0.5, 0.8, 3.4});
  return trace_paths(tracer, tracer, camera, studio_environment(camera), config);
}

TEST(PathTracer, ErrorFallsAtLeastAsTheRootOfSamplesAndSeedsAgree) {
  const Asset asset = make_asset(bumpy_sphere(40, 0.2f));
  const auto tracer = make_tracer(device(), asset);
  const Image truth = picture_of(*tracer, 1024, 1).color;
  const double few = rms(picture_of(*tracer, 4, 2).color, truth),
               many = rms(picture_of(*tracer, 128, 3).color, truth);
  EXPECT_LT(many, few / 5);  // 5.7 were the points random, and the truth exact
}

TEST(PathTracer, SaysItsNoiseAndEqualSeedsGiveEqualPictures) {
  const Asset asset = make_asset(bumpy_sphere(40, 0.2f));
  const auto tracer = make_tracer(device(), asset);
  const PathPicture few = picture_of(*tracer, 8, 5), many = picture_of(*tracer, 128, 5);
  EXPECT_GT(few.noise, 2 * many.noise);
  EXPECT_GT(many.noise, 0);
  EXPECT_EQ(few.color.pixels, picture_of(*tracer, 8, 5).color.pixels);
}

TEST(PathTracer, DenoisingBringsFewSamplesNearerToMany) {
  const Asset asset = make_asset(bumpy_sphere(40, 0.2f));
  const auto tracer = make_tracer(device(), asset);
  const Image truth = picture_of(*tracer, 256, 6, false, 96).color;
  EXPECT_LT(rms(picture_of(*tracer, 4, 7, true, 96).color, truth),
            0.7 * rms(picture_of(*tracer, 4, 7, false, 96).color, truth));
}

TEST(PathTracer, TheGroundIsDarkUnderTheObjectAndClearFarAway) {
  const Asset asset = make_asset(bumpy_sphere(40, 0));
  const auto tracer = make_tracer(device(), asset);
  PathConfig config = config_of(64, 64);
  config.ground = Ground{{0, -1, 0}, {0, 1, 0}};
  const Camera camera{{0, 3, 9}, {0, -0.5, 0}, {0, 1, 0}, 50};
  for (const Environment& environment : {uniform_environment({1, 1, 1}), studio_environment(camera)}) {
    const PathPicture picture = trace_paths(*tracer, *tracer, camera, environment, config);
    const auto alpha = [&](std::size_t x, std::size_t y) { return picture.color.at(x, y)[3]; };
    EXPECT_EQ(alpha(32, 0), 0);           // the sky
    EXPECT_NEAR(alpha(32, 28), 1, 1e-6);  // the ball
    float darkest = 0;
    for (std::size_t y = 36; y < 48; ++y)
      darkest = std::max(darkest, alpha(32, y) < 0.999f ? alpha(32, y) : 0);
    EXPECT_GT(darkest, 0.4f);
    EXPECT_LT(alpha(2, 62), 0.15f);
  }
}

TEST(AmbientOcclusion, SeesAllOfTheSkyFromABallAndHalfOfItFromACorner) {
  const Asset ball = make_asset(bumpy_sphere(60, 0)), walls = make_asset(corner());
  const auto tracer = make_tracer(device(), ball), corner_tracer = make_tracer(device(), walls);
  const Image open = trace_ambient_occlusion(*tracer, *tracer, camera_at({0, 0, 4}), 0, config_of(16, 64));
  for (const float value : open.pixels) EXPECT_GT(value, 0.98f);
  const Image shut =
      trace_ambient_occlusion(*corner_tracer, *corner_tracer, camera_at({0, 0.5, 3}), 0, config_of(32, 64));
  EXPECT_LT(*std::min_element(shut.pixels.begin(), shut.pixels.end()), 0.75f);
  const Image near = trace_ambient_occlusion(*corner_tracer, *corner_tracer, camera_at({0, 0.5, 3}), 0.01f,
                                             config_of(32, 64));
  double far_sum = 0, near_sum = 0;
  for (std::size_t i = 0; i < near.pixels.size(); ++i) {
    far_sum += static_cast<double>(shut.pixels[i]);
    near_sum += static_cast<double>(near.pixels[i]);
  }
  EXPECT_GT(near_sum, far_sum);
}

}  // namespace
}  // namespace rbvh
