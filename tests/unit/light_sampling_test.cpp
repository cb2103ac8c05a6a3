// What paths are sampled by: points, skies and materials, each against its own integral.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "pipeline/light/environment.h"
#include "pipeline/light/material.h"
#include "pipeline/light/sobol.h"
#include "tests/exact_scenes.h"
#include "tests/property.h"

namespace rbvh {
namespace {

constexpr double kPi = std::numbers::pi;

// An even direction on the sphere.
Vec3f even_direction(float u, float v) {
  const float z = 1 - 2 * u, r = std::sqrt(std::max(0.f, 1 - z * z)), phi = 2 * static_cast<float>(kPi) * v;
  return {r * std::cos(phi), r * std::sin(phi), z};
}

Environment gradient_sky() {
  Environment environment;
  environment.up = normalized(Vec3f{0.3f, 0.2f, 1});
  environment.sky = make_image(Image::Kind::kColor, 32, 16, {"R", "G", "B"});
  for (std::size_t y = 0; y < 16; ++y)
    for (std::size_t x = 0; x < 32; ++x)
      for (int c = 0; c < 3; ++c)
        environment.sky.at(x, y)[c] =
            static_cast<float>((x * 7 + y * 13 + static_cast<std::size_t>(c)) % 11) / 5 +
            (x == 9 && y == 4 ? 60 : 0);
  return environment;
}

TEST(Sobol, APowerOfTwoOfPointsIsStratifiedInEachDimension) {
  for (const std::uint32_t seed : {0u, 1u, 77u})
    for (std::uint32_t group = 0; group < 5; ++group) {
      std::set<int> cells[4];
      for (std::uint32_t i = 0; i < 64; ++i) {
        const auto point = sobol_point(i, seed, group);
        for (std::size_t d = 0; d < 4; ++d) {
          ASSERT_GE(point[d], 0);
          ASSERT_LT(point[d], 1);
          cells[d].insert(static_cast<int>(point[d] * 64));
        }
      }
      for (const auto& cell : cells) EXPECT_EQ(cell.size(), 64u) << seed << " " << group;
    }
}

TEST(Sobol, TheFirstTwoDimensionsFillSquares) {
  std::set<int> cells;
  for (std::uint32_t i = 0; i < 64; ++i) {
    const auto point = sobol_point(i, 5, 2);
    cells.insert(static_cast<int>(point[0] * 8) * 8 + static_cast<int>(point[1] * 8));
  }
  EXPECT_EQ(cells.size(), 64u);
}

TEST(Sobol, SeedsAndGroupsAreIndependent) {
  double product = 0;
  constexpr std::uint32_t kPoints = 4096;
  for (std::uint32_t i = 0; i < kPoints; ++i) {
    const double a = static_cast<double>(sobol_point(i, 3, 0)[0]) - 0.5,
                 b = static_cast<double>(sobol_point(i, 3, 1)[0]) - 0.5,
                 c = static_cast<double>(sobol_point(i, 4, 0)[0]) - 0.5;
    product += a * b + a * c;
  }
  EXPECT_LT(std::abs(product / kPoints), 0.01);  // 1/12 were they the same
}

struct NamedEnvironment {
  const char* name;
  Environment environment;
};

std::vector<NamedEnvironment> environments() {
  Camera camera{{0, 0, 5}, {0, 0, 0}, {0, 1, 0}, 30};
  Environment wide_sun = gradient_sky();
  wide_sun.sun = {normalized(Vec3f{1, 1, 0.5f}), {30, 25, 20}, 0.2f};
  return {{"gradient", gradient_sky()},
          {"sun and gradient", wide_sun},
          {"studio", studio_environment(camera)},
          {"headlight", headlight_environment(camera)},
          {"sky", sky_environment({0, 0, 1}, normalized(Vec3f{1, 0, 1}))}};
}

TEST(EnvironmentSampler, DensitiesIntegrateToOneAndSamplesToTheRadiance) {
  for (const auto& [name, environment] : environments()) {
    EnvironmentSampler sampler = make_sampler(environment);
    double density = 0, even = 0, sampled = 0;
    constexpr std::uint32_t kPoints = 1 << 17;
    for (std::uint32_t i = 0; i < kPoints; ++i) {
      const auto p = sobol_point(i, 9, 0);
      const Vec3f direction = even_direction(p[0], p[1]);
      // The sun is too small for even directions: only by its own samples, below.
      if (environment.sun.angle > 0.1f || sampler.sun_share == 0) {
        density += static_cast<double>(pdf(sampler, direction)) * 4 * kPi / kPoints;
        even += static_cast<double>(luminance(radiance(sampler, direction))) * 4 * kPi / kPoints;
      }
      const LightSample light = sample_light(sampler, p[2], p[3], p[1]);
      ASSERT_GT(light.pdf, 0) << name;
      ASSERT_NEAR(length(light.direction), 1, 1e-5);
      sampled += static_cast<double>(luminance(light.radiance) / light.pdf) / kPoints;
    }
    if (even == 0) continue;
    EXPECT_NEAR(density, 1, 0.02) << name;
    EXPECT_NEAR(sampled / even, 1, 0.02) << name;
  }
}

TEST(EnvironmentSampler, NamedSkiesLightAWhitePlaneAsTheySay) {
  const Vec3f up{0, 0, 1};
  for (const double degrees : {5., 40., 80.}) {
    const Vec3f to_sun{static_cast<float>(std::sin(degrees * kPi / 180)), 0,
                       static_cast<float>(std::cos(degrees * kPi / 180))};
    for (const Environment& environment : {sky_environment(up, to_sun), sun_environment(up, to_sun)}) {
      const EnvironmentSampler sampler = make_sampler(environment);
      double sum = 0;
      constexpr std::uint32_t kPoints = 1 << 16;
      for (std::uint32_t i = 0; i < kPoints; ++i) {
        const auto p = sobol_point(i, 1, 0);
        const LightSample light = sample_light(sampler, p[0], p[1], p[2]);
        sum += static_cast<double>(luminance(light.radiance) * std::max(0.f, light.direction.z) / light.pdf) /
               kPoints / kPi;
      }
      EXPECT_NEAR(sum, 1, 0.02) << degrees;
    }
  }
}

TEST(EnvironmentSampler, TheSkyTurnsAboutUpFromItsFront) {
  Environment environment;
  environment.up = {0, 0, 1};
  environment.sky = make_image(Image::Kind::kColor, 4, 2, {"R", "G", "B"});
  for (std::size_t i = 0; i < 8; ++i) environment.sky.pixels[3 * i] = static_cast<float>(i + 1);
  const EnvironmentSampler sampler = make_sampler(environment);
  const Vec3f front = static_cast<Vec3f>(front_of({0, 0, 1})), left = cross(environment.up, front);
  EXPECT_EQ(front, (Vec3f{0, -1, 0}));
  const auto at = [&](float turn, float height) {
    const float phi = turn * 2 * static_cast<float>(kPi);
    return radiance(sampler,
                    normalized(front * std::cos(phi) + left * std::sin(phi) + environment.up * height))
        .x;
  };
  EXPECT_NEAR(at(0.125f, 9), 1, 1e-3);  // the middle of the first column, above
  EXPECT_NEAR(at(0.375f, 9), 2, 1e-3);
  EXPECT_NEAR(at(0.875f, -9), 8, 1e-3);
}

ShadingPoint random_point(Random& random) {
  ShadingPoint at;
  at.geometric = uniform_direction(random);
  do at.view = uniform_direction(random);
  while (dot(at.view, at.geometric) < 0.05f);
  // A smooth normal that leans, and still faces the viewer.
  do at.normal = normalized(at.geometric + uniform_direction(random) * 0.6f);
  while (dot(at.normal, at.view) < 0.02f);
  at.albedo = {1, 1, 1};
  return at;
}

Material material_of(Material::Kind kind, float roughness) {
  Material material;
  material.kind = kind;
  material.roughness = roughness;
  return material;
}

TEST(MaterialSampling, AMatteSurfaceKeepsAllLightWhateverItsSmoothNormal) {
  Random random{property_seed()};
  for (int i = 0; i < 200; ++i) {
    const ShadingPoint at = random_point(random);
    double integral = 0;
    constexpr std::uint32_t kPoints = 1 << 13;
    for (std::uint32_t k = 0; k < kPoints; ++k) {
      const auto p = sobol_point(k, static_cast<std::uint32_t>(i), 0);
      const Scattering s = evaluate({}, at, even_direction(p[0], p[1]));
      EXPECT_EQ(s.value.x, s.pdf);
      integral += static_cast<double>(s.value.x) * 4 * kPi / kPoints;
      const ScatterSample sampled = sample({}, at, p[0], p[1], p[2]);
      ASSERT_EQ(sampled.weight.x, 1);
      ASSERT_GE(dot(sampled.direction, at.geometric), -1e-5f);
    }
    EXPECT_NEAR(integral, 1, 0.02) << i;
  }
}

// Sampled by the material, a function of the direction has the mean that even directions give it.
TEST(MaterialSampling, SamplesFollowTheDensityAndTheValue) {
  Random random{property_seed()};
  for (const auto kind : {Material::Kind::kMatte, Material::Kind::kGlossy, Material::Kind::kMetal})
    for (const float roughness : {0.4f, 0.7f, 1.0f})
      for (int i = 0; i < 10; ++i) {
        const Material material = material_of(kind, roughness);
        ShadingPoint at = random_point(random);
        at.albedo = {0.8f, 0.4f, 0.1f};
        const Vec3f axis = uniform_direction(random);
        const auto function = [&](Vec3f d) { return 1 + static_cast<double>(dot(d, axis)); };
        double even = 0, sampled = 0, density = 0;
        constexpr std::uint32_t kPoints = 1 << 17;
        for (std::uint32_t k = 0; k < kPoints; ++k) {
          const auto p = sobol_point(k, static_cast<std::uint32_t>(i), 0);
          const Vec3f d = even_direction(p[0], p[1]);
          const Scattering s = evaluate(material, at, d);
          even += static_cast<double>(s.value.y) * function(d) * 4 * kPi / kPoints;
          density += static_cast<double>(s.pdf) * 4 * kPi / kPoints;
          const ScatterSample t = sample(material, at, p[2], p[3], p[0]);
          if (t.pdf > 0) sampled += static_cast<double>(t.weight.y) * function(t.direction) / kPoints;
        }
        EXPECT_LT(density, 1.03);
        EXPECT_NEAR(sampled, even, 0.03 * std::max(even, 0.1))
            << static_cast<int>(kind) << " " << roughness << " " << i;
        EXPECT_LT(sampled, 2.0);
      }
}

TEST(MaterialSampling, GlassKeepsItsLightAndBendsByItsIndex) {
  const Material glass = material_of(Material::Kind::kGlass, 0);
  ShadingPoint at;
  at.geometric = at.normal = {0, 0, 1};
  at.albedo = {1, 1, 1};
  at.view = normalized(Vec3f{1, 0, 1});
  const ScatterSample through = sample(glass, at, 0.9f, 0, 0), back = sample(glass, at, 0, 0, 0);
  EXPECT_TRUE(through.is_through);
  EXPECT_NEAR(-through.direction.x * 1.5f, at.view.x, 1e-5f);  // Snell
  EXPECT_NEAR(back.direction.x, -at.view.x, 1e-6f);
  EXPECT_FALSE(back.is_through);
  at.outside = false;  // beyond the angle of total reflection
  for (const float choice : {0.f, 0.5f, 0.999f}) EXPECT_FALSE(sample(glass, at, choice, 0, 0).is_through);
  at.view = {0, 0, 1};
  int reflected = 0;
  for (int i = 0; i < 1000; ++i)
    reflected += sample(glass, at, static_cast<float>(i) / 1000, 0, 0).is_through ? 0 : 1;
  EXPECT_EQ(reflected, 40);  // ((n - 1) / (n + 1))^2
}

}  // namespace
}  // namespace rbvh
