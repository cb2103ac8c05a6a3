// Light by brute force in double precision: directions are sampled evenly over the hemisphere, lights only
// met by chance. Shares no code with the path tracer.
#pragma once

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "tests/oracle.h"

namespace rbvh::oracle {

struct LitScene {
  enum class Kind { kMatte, kGlossy, kMetal, kGlass };
  std::vector<std::array<Point, 3>> triangles;  // fronts counterclockwise
  Kind kind = Kind::kMatte;
  double albedo = 1, roughness = 0.5, ior = 1.5;
  double sky = 0;  // radiance from everywhere
  Point sun{0, 0, 1};
  double sun_radiance = 0, sun_cos = 1;
};

inline Point add(const Point& a, const Point& b, double s) {
  return {a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]};
}

inline Point unit(const Point& a) {
  const double l = std::sqrt(dot(a, a));
  return {a[0] / l, a[1] / l, a[2] / l};
}

class LitPaths {
 public:
  LitPaths(const LitScene& scene, std::uint64_t seed) : scene_(scene), random_(seed) {}

  /// One path's radiance.
  double trace(Point o, Point d) {
    double weight = 1;
    for (int bounce = 0; bounce < 40; ++bounce) {
      double t = 1e300;
      Point n{};
      for (const auto& [a, b, c] : scene_.triangles) {
        const Meeting m = intersect_triangle(a, b, c, o, d);
        if (m.crosses && m.inside >= 0 && m.t > 1e-9 && m.t < t) {
          t = m.t;
          n = m.normal;
        }
      }
      if (t == 1e300) return weight * light(d);
      o = add(o, d, t);
      const bool front = dot(n, d) < 0;
      if (!front) n = {-n[0], -n[1], -n[2]};
      const Point view{-d[0], -d[1], -d[2]};
      d = scene_.kind == LitScene::Kind::kGlass ? through_glass(n, view, front) : scatter(n, view, weight);
      if (bounce > 4) {
        if (even() > 0.8) return 0;
        weight /= 0.8;
      }
    }
    return 0;
  }

  double even() { return std::uniform_real_distribution<double>(0, 1)(random_); }

 private:
  static double fresnel(double cos, double ior) {
    const double s2 = (1 - cos * cos) / (ior * ior);
    if (s2 >= 1) return 1;
    const double ct = std::sqrt(1 - s2), rs = (cos - ior * ct) / (cos + ior * ct),
                 rp = (ct - ior * cos) / (ct + ior * cos);
    return (rs * rs + rp * rp) / 2;
  }

  double light(const Point& d) const {
    return scene_.sky + (dot(unit(d), scene_.sun) >= scene_.sun_cos ? scene_.sun_radiance : 0);
  }

  // Walter et al. 2007, equations 33 and 34; Heitz 2014, equation 99.
  double ggx(const Point& n, const Point& view, const Point& out) const {
    const double alpha = scene_.roughness * scene_.roughness;
    const Point h = unit(add(view, out, 1));
    const double c = dot(n, h), tan2 = (1 - c * c) / (c * c);
    const double d = alpha * alpha / (std::numbers::pi * std::pow(c, 4) * std::pow(alpha * alpha + tan2, 2));
    const auto lambda = [&](double cos) {
      return (-1 + std::sqrt(1 + alpha * alpha * (1 - cos * cos) / (cos * cos))) / 2;
    };
    return d / (1 + lambda(dot(n, view)) + lambda(dot(n, out))) / (4 * dot(n, view) * dot(n, out));
  }

  double bsdf(const Point& n, const Point& view, const Point& out) const {
    const double half_cos = dot(view, unit(add(view, out, 1)));
    switch (scene_.kind) {
      case LitScene::Kind::kGlossy:
        return scene_.albedo / std::numbers::pi * (1 - fresnel(dot(n, view), scene_.ior)) *
                   (1 - fresnel(dot(n, out), scene_.ior)) +
               ggx(n, view, out) * fresnel(half_cos, scene_.ior);
      case LitScene::Kind::kMetal:
        return ggx(n, view, out) * (scene_.albedo + (1 - scene_.albedo) * std::pow(1 - half_cos, 5));
      default:
        return scene_.albedo / std::numbers::pi;
    }
  }

  Point scatter(const Point& n, const Point& view, double& weight) {
    const double z = even(), phi = 2 * std::numbers::pi * even(), r = std::sqrt(1 - z * z);
    const Point x = unit(std::abs(n[0]) > 0.5 ? cross(n, {0, 1, 0}) : cross(n, {1, 0, 0})), y = cross(n, x);
    const Point d = add(add(add({0, 0, 0}, x, r * std::cos(phi)), y, r * std::sin(phi)), n, z);
    weight *= bsdf(n, view, d) * z * 2 * std::numbers::pi;
    return d;
  }

  Point through_glass(const Point& n, const Point& view, bool front) {
    const double ior = front ? scene_.ior : 1 / scene_.ior, cos = dot(n, view);
    if (even() < fresnel(cos, ior)) return add({-view[0], -view[1], -view[2]}, n, 2 * cos);
    const double s2 = (1 - cos * cos) / (ior * ior);
    const Point along = add({-view[0], -view[1], -view[2]}, n, cos);
    return add({along[0] / ior, along[1] / ior, along[2] / ior}, n, -std::sqrt(1 - s2));
  }

  const LitScene& scene_;
  std::mt19937_64 random_;
};

}  // namespace rbvh::oracle
