#include "pipeline/light/light_words.h"

#include <cmath>
#include <filesystem>
#include <numbers>

#include "pipeline/base/error.h"
#include "pipeline/base/words.h"

namespace rbvh {

Material parse_material(std::string_view text) {
  const std::size_t colon = text.find(':');
  const std::string_view name = text.substr(0, colon);
  const auto value = [&](double fallback, double least, double most) {
    return static_cast<float>(
        colon == std::string_view::npos ? fallback : parse_between(text.substr(colon + 1), least, most));
  };
  Material material;
  if (name == "glossy") {
    material.kind = Material::Kind::kGlossy;
    material.roughness = value(0.3, 0, 1);
  } else if (name == "metal") {
    material.kind = Material::Kind::kMetal;
    material.roughness = value(0.3, 0, 1);
  } else if (name == "glass") {
    material.kind = Material::Kind::kGlass;
    material.ior = value(1.5, 1.01, 4);
    material.color = Vec3f{1, 1, 1};
  } else if (text == "clay") {
    material.color = kClay;
  } else if (text != "matte") {
    throw Error(
        ErrorKind::kUsage, "",
        "'" + std::string(text) + "' is none of matte, clay, glossy:ROUGHNESS, metal:ROUGHNESS, glass:IOR");
  }
  return material;
}

LightWords::Sun parse_sun(std::string_view text) {
  const std::size_t comma = text.find(',');
  if (comma == std::string_view::npos)
    throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not two angles, such as 45,30");
  return {parse_between(text.substr(0, comma), -360, 360),
          parse_between(text.substr(comma + 1), kLowestSun, 90)};
}

double parse_seconds(std::string_view text) {
  return parse_above_zero(text.ends_with('s') ? text.substr(0, text.size() - 1) : text);
}

int parse_bounces(std::string_view text) { return parse_integer_between(text, 1, 1000); }

std::uint32_t parse_seed(std::string_view text) {
  return static_cast<std::uint32_t>(parse_integer_between(text, 1, 1 << 30));
}

Aov parse_aov(std::string_view text) {
  if (const auto aov = find_aov(text)) return *aov;
  throw Error(
      ErrorKind::kUsage, "",
      "'" + std::string(text) +
          "' is none of shaded, normal, depth, position, leaf, steps, ao, albedo, shadow, direct, indirect");
}

std::string parse_light(std::string_view text) {
  std::string light(text);
  std::error_code code;
  if (!is_light_name(light) && !std::filesystem::exists(light, code))
    throw Error(ErrorKind::kUsage, "",
                "'" + light + "' is none of studio, headlight, sky, sun, white, and no file");
  return light;
}

bool is_light_name(std::string_view word) {
  return word == "studio" || word == "headlight" || word == "sky" || word == "sun" || word == "white";
}

Environment make_environment(const LightWords& words, const Camera& camera, Vec3f up) {
  if (words.light == "studio") return studio_environment(camera);
  if (words.light == "headlight") return headlight_environment(camera);
  if (words.light == "white") return uniform_environment({1, 1, 1});
  Environment environment;
  environment.sky = words.map;
  environment.up = up;
  if (words.light != "sky" && words.light != "sun") return environment;
  constexpr double kDegree = std::numbers::pi / 180;
  const double azimuth = words.sun.azimuth * kDegree, elevation = words.sun.elevation * kDegree;
  const Vec3d z = static_cast<Vec3d>(up), front = front_of(z), left = cross(z, front);
  const Vec3f to_sun = static_cast<Vec3f>(
      (front * std::cos(azimuth) + left * std::sin(azimuth)) * std::cos(elevation) + z * std::sin(elevation));
  return words.light == "sky" ? sky_environment(up, to_sun) : sun_environment(up, to_sun);
}

}  // namespace rbvh
