#include "pipeline/render/shade.h"

#include <gtest/gtest.h>

#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/trace/camera_rays.h"
#include "pipeline/trace/disc_surface.h"
#include "pipeline/trace/surface.h"
#include "rbvh/camera.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kSize = 64;
const Hit kMiss{std::numeric_limits<float>::infinity(), {0, 0, 0}, 0, 0, RBVH_NO_LEAF, 0};

CameraRays front_camera() {
  CameraWords words;
  words.position = Vec3d{0, 0, 10};
  words.focal_point = Vec3d{};
  words.view_up = Vec3d{0, 1, 0};
  return camera_rays(place_camera(words, {}, {0, 1, 0}, 1), kSize, kSize);
}

// A ball of radius 2 at the origin, by the textbook; `inside_out` flips its normals.
std::vector<Hit> ball(const CameraRays& rays, bool inside_out = false) {
  std::vector<Hit> hits(kSize * kSize, kMiss);
  for (std::uint32_t y = 0; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x) {
      const Vec3d d = static_cast<Vec3d>(pixel_direction(rays, x, y)), o{0, 0, 10};
      const double b = dot(o, d), root = b * b - (dot(o, o) - 4);
      if (root < 0) continue;
      const double t = -b - std::sqrt(root);
      Vec3d n = (o + d * t) * 0.5;
      if (inside_out) n = -n;
      hits[y * kSize + x] = {static_cast<float>(t),
                             {static_cast<float>(n.x), static_cast<float>(n.y), static_cast<float>(n.z)},
                             0.25f,
                             0.25f,
                             0,
                             0};
    }
  return hits;
}

SurfaceSamples own_normals(const std::vector<Hit>& hits) {
  SurfaceSamples s;
  for (const Hit& hit : hits) s.normals.push_back({hit.normal[0], hit.normal[1], hit.normal[2]});
  return s;
}

float brightness(const Image& image, std::uint32_t x, std::uint32_t y) {
  const float* p = image.at(x, y);
  return p[0] + p[1] + p[2];
}

TEST(Shade, TheBackgroundIsTransparentAndTheObjectOpaque) {
  const CameraRays rays = front_camera();
  const std::vector<Hit> hits = ball(rays);
  const Image image = shade(rays, hits, own_normals(hits), {0, 1, 0});
  EXPECT_EQ(image.at(0, 0)[3], 0);
  EXPECT_EQ(image.at(32, 32)[3], 1);
  for (const float v : image.pixels) EXPECT_TRUE(v >= 0 && v <= 1);
}

TEST(Shade, LightComesFromAboveAndTheFront) {
  const CameraRays rays = front_camera();
  const std::vector<Hit> hits = ball(rays);
  const Image image = shade(rays, hits, own_normals(hits), {0, 1, 0});
  EXPECT_GT(brightness(image, 32, 22), brightness(image, 32, 42) * 1.2f);
  EXPECT_GT(brightness(image, 32, 32), 0.3f);
}

TEST(Shade, BackFacesAreLitTooButDarker) {
  const CameraRays rays = front_camera();
  const std::vector<Hit> front = ball(rays), back = ball(rays, true);
  const float lit = brightness(shade(rays, front, own_normals(front), {0, 1, 0}), 32, 32);
  const float inside = brightness(shade(rays, back, own_normals(back), {0, 1, 0}), 32, 32);
  EXPECT_LT(inside, lit);
  EXPECT_GT(inside, 0.3f * lit);
}

TEST(Shade, SurfaceColoursShow) {
  const CameraRays rays = front_camera();
  const std::vector<Hit> hits = ball(rays);
  SurfaceSamples surface = own_normals(hits);
  surface.colors.assign(hits.size(), {0.8f, 0.05f, 0.05f});
  const Image image = shade(rays, hits, surface, {0, 1, 0});
  EXPECT_GT(image.at(32, 32)[0], 3 * image.at(32, 32)[1]);
}

TEST(Shade, AGrooveIsDarkerThanAPlane) {
  const CameraRays rays = front_camera();
  std::vector<Hit> plane(kSize * kSize);
  for (std::uint32_t y = 0; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x) {
      const Vec3f d = pixel_direction(rays, x, y);
      plane[y * kSize + x] = {-10 / d.z, {0, 0, 1}, 0, 0, 0, 0};
    }
  std::vector<Hit> groove = plane;
  for (std::uint32_t y = 0; y < kSize; ++y) groove[y * kSize + 32].t += 0.05f;
  const Image flat = shade(rays, plane, own_normals(plane), {0, 1, 0});
  const Image cut = shade(rays, groove, own_normals(groove), {0, 1, 0});
  EXPECT_LT(brightness(cut, 32, 32), 0.95f * brightness(flat, 32, 32));
  EXPECT_FLOAT_EQ(brightness(cut, 10, 32), brightness(flat, 10, 32));
}

TEST(SampleSurface, ATriangleBlendsItsCornersInLinearLight) {
  Scan scan;
  scan.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  scan.normals = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  scan.colors = {{255, 255, 255}, {0, 0, 0}, {0, 0, 0}};
  scan.triangles = {{0, 1, 2}};
  const std::vector<Hit> hits = {{1, {0, 0, 1}, 0.25f, 0.5f, 0, 0}, {1, {0, 0, 1}, 0, 0, 0, 0}, kMiss};
  const SurfaceSamples s = sample_surface(scan, shading_normals(scan), TextureSampler(scan), hits, 0);
  const Vec3f expected = normalized(Vec3f{0.25f, 0.25f, 0.5f});
  EXPECT_NEAR(length(s.normals[0] - expected), 0, 1e-6);
  EXPECT_NEAR(s.colors[0].x, 0.25f, 1e-6);
  EXPECT_EQ(s.normals[1], (Vec3f{1, 0, 0}));
  EXPECT_EQ(s.normals[2], (Vec3f{}));
}

// Two discs of radius 1, a bit tilted against each other, and a hit on the second, along its own axes.
struct TwoDiscs {
  Scan cloud;
  Hit hit{.t = 1, .normal = {0, 0, 1}, .u = 0, .v = 0, .leaf = 1, .flags = 0};

  explicit TwoDiscs(const Vec3f& first) {
    cloud.positions = {first, {1, 0, 0}};
    cloud.normals = {normalized(Vec3f{0.1f, 0, 1}), {0, 0, 1}};
    cloud.radii = {1, 1};
    cloud.colors = {{0, 0, 0}, {255, 0, 0}};
  }
  SurfaceSamples sample() const {
    return sample_surface(cloud, make_disc_surface(cloud), std::vector<Hit>{kMiss, hit});
  }
};

TEST(SampleSurface, DiscsAreBlendedWhereTheyOverlap) {
  TwoDiscs discs({0, 0, 0});
  discs.hit.u = -0.5f;
  const SurfaceSamples s = discs.sample();
  EXPECT_EQ(s.normals[0], (Vec3f{}));
  EXPECT_NEAR(s.colors[1].x, 0.5f, 0.01f) << "halfway between the two";
  EXPECT_NEAR(s.normals[1].x, 0.05f, 0.001f);
  // Nearer to one centre more of its own, and beyond the other's edge nothing else.
  discs.hit.u = -0.3f;
  EXPECT_GT(discs.sample().colors[1].x, 0.6f);
  discs.hit.u = 0.1f;
  EXPECT_EQ(discs.sample().colors[1].x, 1);
  EXPECT_EQ(discs.sample().normals[1], (Vec3f{0, 0, 1}));
}

TEST(SampleSurface, DiscsOfOtherSurfacesAreNotBlended) {
  TwoDiscs below({1, 0, -0.6f});
  EXPECT_EQ(below.sample().colors[1].x, 1) << "further below than a disc is thick";
  TwoDiscs near({1, 0, -0.2f});
  EXPECT_LT(near.sample().colors[1].x, 0.6f);
  TwoDiscs other_side({1, 0, -0.2f});
  other_side.cloud.normals[0] = -other_side.cloud.normals[0];
  EXPECT_EQ(other_side.sample().colors[1].x, 1) << "it faces the other way";
}

TEST(SampleSurface, ALoneDiscHasItsOwnNormalAndColourUpToItsEdge) {
  TwoDiscs discs({9, 9, 9});
  for (const float u : {0.0f, 0.7f, 1.0f}) {
    discs.hit.u = u;
    EXPECT_NEAR(length(discs.sample().normals[1] - Vec3f{0, 0, 1}), 0, 1e-6) << u;
    EXPECT_NEAR(discs.sample().colors[1].x, 1, 1e-6) << u;
  }
}

// A 3 x 2 tile at (1, 1) of a 5 x 4 atlas.
Level small_level() {
  Level level;
  level.atlas_width = 5;
  level.atlas_height = 4;
  RbvhLeaf leaf{};
  leaf.x = leaf.y = 1;
  leaf.width = 3;
  leaf.height = 2;
  level.leaves = {leaf};
  const std::uint16_t up_z = 0x8080, up_x = 0x80ff, down_z = 0xffff;  // octahedral: centre, right, corner
  Layer height{"height", 1, std::vector<std::uint16_t>(20, 0)},
      normal{"normal", 1, std::vector<std::uint16_t>(20, down_z)},
      color{"color", 1, std::vector<std::uint16_t>(20, 0)};
  for (const std::size_t row : {1u, 2u})
    for (std::size_t x = 1; x <= 3; ++x) {
      height.texels[row * 5 + x] = 100;
      normal.texels[row * 5 + x] = x == 1 ? up_z : up_x;
      color.texels[row * 5 + x] = x == 1 ? 0xf800 : 0x001f;  // red, blue
    }
  level.layers = {height, normal, color};
  return level;
}

TEST(SampleSurface, ATileIsBilinearBetweenTexelCentres) {
  const Level level = small_level();
  // u from 0 to 1 runs over three texels: 0.25 lies half way between the first two.
  const SurfaceSamples s = sample_surface(
      level, std::vector<Hit>{
                 {1, {0, 1, 0}, 0, 0, 0, 0}, {1, {0, 1, 0}, 0.25f, 1, 0, 0}, {1, {0, 1, 0}, 1, 1, 0, 0}});
  EXPECT_NEAR(length(s.normals[0] - Vec3f{0, 0, 1}), 0, 1e-2);
  EXPECT_NEAR(length(s.normals[1] - normalized(Vec3f{1, 0, 1})), 0, 1e-2);
  EXPECT_NEAR(length(s.normals[2] - Vec3f{1, 0, 0}), 0, 1e-2);
  EXPECT_NEAR(s.colors[0].x, 1, 1e-6);
  EXPECT_NEAR(s.colors[1].x, 0.5f, 1e-6);
  EXPECT_NEAR(s.colors[1].z, 0.5f, 1e-6);
}

TEST(SampleSurface, PrimitivesHaveTheirVerticesNormalsAndColours) {
  Level level = small_level();
  level.leaves.emplace_back();
  level.leaves[1].width = level.leaves[1].height = 2;
  level.leaves[1].primitives = 2;
  level.primitive_leaves = {{1, 0}};
  level.primitives.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  level.primitives.normals = {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0}};
  level.primitives.colors = {{255, 0, 0}, {0, 0, 0}, {0, 0, 255}, {0, 0, 0}};
  level.primitives.triangles = {{3, 3, 3}, {0, 1, 2}};
  // At the first corner of the second triangle, in the middle of its far edge, and on one without a normal.
  const rbvh_u32 second = RBVH_HIT_ON_PRIMITIVE | 1u << RBVH_HIT_PRIMITIVE_SHIFT;
  const SurfaceSamples s =
      sample_surface(level, std::vector<Hit>{{1, {0, 0, 1}, 0, 0, 1, second},
                                             {1, {0, 0, 1}, 0.5f, 0.5f, 1, second},
                                             {1, {0, 0.6f, 0.8f}, 0.5f, 0.5f, 1, RBVH_HIT_ON_PRIMITIVE}});
  EXPECT_EQ(s.normals[0], (Vec3f{0, 0, 1}));
  EXPECT_NEAR(length(s.normals[1] - normalized(Vec3f{1, 1, 0})), 0, 1e-6);
  EXPECT_EQ(s.normals[2], (Vec3f{0, 0.6f, 0.8f}));
  EXPECT_NEAR(s.colors[0].x, 1, 1e-6);
  EXPECT_NEAR(s.colors[1].z, 0.5f, 1e-6);
}

TEST(SampleSurface, EmptyTexelsDoNotBleedIn) {
  Level level = small_level();
  for (const std::size_t row : {1u, 2u}) level.layers[0].texels[row * 5 + 2] = 0;
  const SurfaceSamples s = sample_surface(level, std::vector<Hit>{{1, {0, 1, 0}, 0.25f, 0, 0, 0}});
  EXPECT_NEAR(length(s.normals[0] - Vec3f{0, 0, 1}), 0, 1e-2);
  EXPECT_NEAR(s.colors[0].z, 0, 1e-6);
  for (std::uint16_t& height : level.layers[0].texels) height = 0;
  EXPECT_EQ(sample_surface(level, std::vector<Hit>{{1, {0, 1, 0}, 0.5f, 0, 0, 0}}).normals[0],
            (Vec3f{0, 1, 0}));
}

TEST(Aovs, HoldWhatTheyAreNamedAfter) {
  const CameraRays rays = front_camera();
  const std::vector<Hit> hits = ball(rays);
  const Image depth = data_image(Aov::kDepth, rays, hits);
  EXPECT_EQ(depth.channels, std::vector<std::string>{"Z"});
  EXPECT_TRUE(std::isinf(*depth.at(0, 0)));
  EXPECT_NEAR(*depth.at(32, 32), 8, 0.02);
  const Image position = data_image(Aov::kPosition, rays, hits);
  const float* p = position.at(32, 22);
  EXPECT_NEAR(std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]), 2, 1e-4);
  EXPECT_GT(p[1], 0);
  const Image normal = data_image(Aov::kNormal, rays, hits);
  EXPECT_NEAR(normal.at(32, 32)[2], 1, 0.02);
  const Image leaf = data_image(Aov::kLeaf, rays, hits);
  EXPECT_EQ(*leaf.at(32, 32), 0);
  EXPECT_EQ(*leaf.at(0, 0), -1);
}

TEST(Aovs, EightBitsShowWhatTheyCan) {
  const CameraRays rays = front_camera();
  const std::vector<Hit> hits = ball(rays);
  const Image normal = shown_image(Aov::kNormal, data_image(Aov::kNormal, rays, hits));
  EXPECT_NEAR(normal.at(32, 32)[2], 1, 0.02);
  EXPECT_NEAR(normal.at(32, 32)[0], 0.5f, 0.03);
  EXPECT_EQ(normal.at(0, 0)[3], 0);
  std::vector<std::uint32_t> steps(kSize * kSize, 1);
  std::fill_n(steps.begin(), 40, 50u);
  EXPECT_NE(*shown_image(Aov::kSteps, steps_image(rays, steps)).at(0, 0),
            *shown_image(Aov::kSteps, steps_image(rays, steps)).at(5, 5));
  EXPECT_THROW(shown_image(Aov::kDepth, data_image(Aov::kDepth, rays, hits)), Error);
  EXPECT_EQ(find_aov("steps"), Aov::kSteps);
  EXPECT_FALSE(find_aov("Shaded").has_value());
}

}  // namespace
}  // namespace rbvh
