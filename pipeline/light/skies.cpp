// The environments that have a name.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/light/environment.h"

namespace rbvh {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::uint32_t kHeight = 256;  // of a sky: as fine as soft lights need; the sun is not in it
constexpr std::size_t kRows = 8;

constexpr Vec3f kRoom{0.20f, 0.21f, 0.23f}, kFloor{0.10f, 0.095f, 0.09f};

/// Even radiance over a cone's soft edge: about exp(sharpness * (cos - 1)) around a direction, which sends
/// 2 pi radiance / sharpness at a plane that faces it.
struct SoftLight {
  Vec3f direction, color;
  float irradiance = 0;  // in units of pi: the radiance of a white plane that faces it
  float sharpness = 1;
};

/// radiance(direction) for each pixel of a sky.
template <class Radiance>
Image paint_sky(Vec3f up, const Radiance& radiance) {
  Image sky = make_image(Image::Kind::kColor, 2 * kHeight, kHeight, {"R", "G", "B"});
  const Vec3f x = static_cast<Vec3f>(front_of(static_cast<Vec3d>(up))), y = cross(up, x);
  parallel_for(sky.height, kRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row)
      for (std::size_t column = 0; column < sky.width; ++column) {
        const double theta = kPi * (static_cast<double>(row) + 0.5) / sky.height;
        const double phi = 2 * kPi * (static_cast<double>(column) + 0.5) / sky.width;
        const auto along = [](double value) { return static_cast<float>(value); };
        const Vec3f direction = x * along(std::sin(theta) * std::cos(phi)) +
                                y * along(std::sin(theta) * std::sin(phi)) + up * along(std::cos(theta));
        const Vec3f color = radiance(direction);
        float* out = sky.at(column, row);
        for (int c = 0; c < 3; ++c) out[c] = color[c];
      }
  });
  return sky;
}

Environment room(Vec3f up, std::vector<SoftLight> lights) {
  Environment environment;
  environment.up = normalized(up);
  environment.sky = paint_sky(environment.up, [&](Vec3f direction) {
    const float height = 0.5f + 0.5f * dot(direction, environment.up);
    Vec3f color = kFloor * (1 - height) + kRoom * height;
    for (const SoftLight& light : lights)
      color = color + light.color * (light.irradiance * light.sharpness / 2 *
                                     std::exp(light.sharpness * (dot(direction, light.direction) - 1)));
    return color;
  });
  return environment;
}

struct CameraAxes {
  Vec3f back, right, up;
};

CameraAxes axes_of(const Camera& camera) {
  const Vec3d back = normalized(camera.position - camera.focal_point);
  const Vec3d right = normalized(cross(camera.up, back));
  return {static_cast<Vec3f>(back), static_cast<Vec3f>(right), static_cast<Vec3f>(cross(back, right))};
}

// Perez' five coefficients at a turbidity, by Preetham, Shirley, Smits 1999, appendix A.2.
struct Perez {
  double a, b, c, d, e;

  // Over zenith angle and angle to the sun, up to the zenith's own value.
  double operator()(double cos_theta, double gamma) const {
    const double cos_gamma = std::cos(gamma);
    return (1 + a * std::exp(b / std::max(cos_theta, 0.01))) *
           (1 + c * std::exp(d * gamma) + e * cos_gamma * cos_gamma);
  }
};

double zenith_chromaticity(const double (&m)[3][4], double turbidity, double theta) {
  const double t[3] = {turbidity * turbidity, turbidity, 1};
  const double s[4] = {theta * theta * theta, theta * theta, theta, 1};
  double sum = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) sum += t[i] * m[i][j] * s[j];
  return sum;
}

// CIE xyY to linear sRGB, no component below zero.
Vec3d rgb_of(double x, double y, double luminance) {
  const double big_x = x / y * luminance, big_z = (1 - x - y) / y * luminance;
  const Vec3d c{3.2406 * big_x - 1.5372 * luminance - 0.4986 * big_z,
                -0.9689 * big_x + 1.8758 * luminance + 0.0415 * big_z,
                0.0557 * big_x - 0.2040 * luminance + 1.0570 * big_z};
  return {std::max(0., c.x), std::max(0., c.y), std::max(0., c.z)};
}

// Luminance in kcd/m^2 above the horizon.
struct PreethamSky {
  Perez luminance, x, y;
  double zenith_luminance, zenith_x, zenith_y, theta_sun;

  Vec3d operator()(double cos_theta, double gamma) const {
    const auto of = [&](const Perez& f, double zenith) {
      return zenith * f(cos_theta, gamma) / f(1, theta_sun);
    };
    return rgb_of(of(x, zenith_x), of(y, zenith_y), std::max(0., of(luminance, zenith_luminance)));
  }
};

PreethamSky preetham(double t, double theta_sun) {
  static constexpr double kX[3][4] = {{0.00166, -0.00375, 0.00209, 0},
                                      {-0.02903, 0.06377, -0.03202, 0.00394},
                                      {0.11693, -0.21196, 0.06052, 0.25886}};
  static constexpr double kY[3][4] = {{0.00275, -0.00610, 0.00317, 0},
                                      {-0.04214, 0.08970, -0.04153, 0.00516},
                                      {0.15346, -0.26756, 0.06670, 0.26688}};
  const double chi = (4. / 9 - t / 120) * (kPi - 2 * theta_sun);
  return {{0.1787 * t - 1.4630, -0.3554 * t + 0.4275, -0.0227 * t + 5.3251, 0.1206 * t - 2.5771,
           -0.0670 * t + 0.3703},
          {-0.0193 * t - 0.2592, -0.0665 * t + 0.0008, -0.0004 * t + 0.2125, -0.0641 * t - 0.8989,
           -0.0033 * t + 0.0452},
          {-0.0167 * t - 0.2608, -0.0950 * t + 0.0092, -0.0079 * t + 0.2102, -0.0441 * t - 1.6537,
           -0.0109 * t + 0.0529},
          (4.0453 * t - 4.9710) * std::tan(chi) - 0.2155 * t + 2.4192,
          zenith_chromaticity(kX, t, theta_sun),
          zenith_chromaticity(kY, t, theta_sun),
          theta_sun};
}

// What comes through the air from the sun, klx on a plane that faces it (appendix A.1: Rayleigh's scattering
// and aerosols, at the wavelengths of red, green and blue).
Vec3d sun_illuminance(double turbidity, double theta) {
  constexpr double kOutside = 128;
  constexpr double kMicrometres[3] = {0.61, 0.55, 0.465};
  const double degrees = theta * 180 / kPi;
  const double mass = 1 / (std::cos(theta) + 0.15 * std::pow(93.885 - degrees, -1.253));
  const double beta = 0.04608 * turbidity - 0.04586;
  Vec3d through;
  for (int c = 0; c < 3; ++c)
    through[c] = kOutside * std::exp(-mass * (0.008735 * std::pow(kMicrometres[c], -4.08) +
                                              beta * std::pow(kMicrometres[c], -1.3)));
  return through;
}

void scale(Environment& environment, double factor) {
  for (float& value : environment.sky.pixels) value *= static_cast<float>(factor);
  environment.sun.radiance = environment.sun.radiance * static_cast<float>(factor);
}

// Of a white plane that faces `up`, lit by the upper half of the sky.
double zenith_radiance(const Image& sky) {
  double sum = 0;
  for (std::size_t y = 0; y < sky.height / 2; ++y) {
    const double theta = kPi * (static_cast<double>(y) + 0.5) / sky.height;
    for (std::size_t x = 0; x < sky.width; ++x) {
      const float* p = sky.at(x, y);
      sum += static_cast<double>(luminance({p[0], p[1], p[2]})) * std::cos(theta) * std::sin(theta);
    }
  }
  return sum * 2 * kPi / (static_cast<double>(sky.width) * sky.height);
}

// Of radiance such that a plane that faces the sun gets `irradiance`.
Sun make_sun(Vec3f to_sun, Vec3d irradiance) {
  Sun sun;
  sun.direction = normalized(to_sun);
  const double s = std::sin(static_cast<double>(sun.angle));
  sun.radiance = static_cast<Vec3f>(irradiance * (1 / (kPi * s * s)));
  return sun;
}

double sun_zenith_angle(Vec3f up, Vec3f to_sun) {
  const double angle = std::acos(std::clamp(static_cast<double>(dot(up, normalized(to_sun))), -1., 1.));
  RBVH_CHECK(angle <= 85.01 * kPi / 180);
  return angle;
}

}  // namespace

Environment uniform_environment(Vec3f radiance) {
  Environment environment;
  environment.sky = make_image(Image::Kind::kColor, 1, 1, {"R", "G", "B"});
  for (int c = 0; c < 3; ++c) environment.sky.pixels[static_cast<std::size_t>(c)] = radiance[c];
  return environment;
}

Environment studio_environment(const Camera& camera) {
  const CameraAxes at = axes_of(camera);
  const Vec3f key = normalized(at.back * 0.75f + at.up * 0.65f - at.right * 0.55f);
  const Vec3f fill = normalized(at.back * 0.6f + at.up * 0.1f + at.right * 0.9f);
  const Vec3f edge = normalized(at.back * -0.6f + at.up * 0.5f + at.right * 0.4f);
  return room(at.up, {{key, {1.0f, 0.97f, 0.92f}, 1.25f, 14},
                      {fill, {0.86f, 0.93f, 1.0f}, 0.3f, 6},
                      {edge, {1.0f, 1.0f, 1.0f}, 0.35f, 24}});
}

Environment headlight_environment(const Camera& camera) {
  const CameraAxes at = axes_of(camera);
  return room(at.up, {{at.back, {1, 1, 1}, 1.1f, 200}});
}

Environment sky_environment(Vec3f up, Vec3f to_sun, float turbidity) {
  Environment environment;
  environment.up = normalized(up);
  const double theta_sun = sun_zenith_angle(environment.up, to_sun);
  const PreethamSky sky = preetham(static_cast<double>(turbidity), theta_sun);
  const Vec3f sun = normalized(to_sun);
  environment.sky = paint_sky(environment.up, [&](Vec3f direction) {
    const double cos_theta = static_cast<double>(dot(direction, environment.up));
    if (cos_theta <= 0) return Vec3f{};
    return static_cast<Vec3f>(
        sky(cos_theta, std::acos(std::clamp(static_cast<double>(dot(direction, sun)), -1., 1.))));
  });
  const Vec3d direct = sun_illuminance(static_cast<double>(turbidity), theta_sun);
  environment.sun = make_sun(sun, direct);
  const double sun_part =
      static_cast<double>(luminance(static_cast<Vec3f>(direct))) * std::cos(theta_sun) / kPi;
  const double all = zenith_radiance(environment.sky) + sun_part;
  scale(environment, 1 / all);
  // What a ground of albedo 0.2 throws back.
  for (std::size_t y = environment.sky.height / 2; y < environment.sky.height; ++y)
    for (std::size_t x = 0; x < environment.sky.width; ++x) {
      float* p = environment.sky.at(x, y);
      p[0] = 0.21f;
      p[1] = 0.20f;
      p[2] = 0.18f;
    }
  return environment;
}

Environment sun_environment(Vec3f up, Vec3f to_sun) {
  Environment environment = uniform_environment({1, 1, 1});
  environment.up = normalized(up);
  const double theta = sun_zenith_angle(environment.up, to_sun);
  constexpr double kShadows = 0.12;  // of the light on the plane that faces the zenith
  scale(environment, kShadows);
  const double facing = (1 - kShadows) * kPi / std::cos(theta);
  environment.sun = make_sun(to_sun, {facing, facing, facing});
  return environment;
}

}  // namespace rbvh
