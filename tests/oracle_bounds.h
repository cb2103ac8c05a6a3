// Brute force in double precision with bounds on what float may differ by.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "kernels/common/layout.h"
#include "rbvh/scan.h"
#include "tests/exact_scenes.h"
#include "tests/oracle.h"

namespace rbvh {

struct Bounded {
  oracle::Meeting meeting;
  double inside_error = 0, t_error = 0;
};

/// How a ray meets a scan's primitive i; nothing where that has no definite answer.
inline std::optional<Bounded> meet(const Scan& scan, std::size_t i, const Ray& ray) {
  const oracle::Point o = {ray.origin[0], ray.origin[1], ray.origin[2]};
  const oracle::Point d = {ray.direction[0], ray.direction[1], ray.direction[2]};
  constexpr double kRounding = 16.0 / (1 << 24);
  const double length = std::sqrt(oracle::dot(d, d));
  double reach = 0, size = 0, longest = 0;
  Bounded b;
  const auto extend = [&](const oracle::Point& p) {
    const oracle::Point s = oracle::sub(p, o);
    reach = std::max({reach, std::sqrt(oracle::dot(s, s)), std::abs(p[0]), std::abs(p[1]), std::abs(p[2])});
  };
  if (scan.is_cloud()) {
    const oracle::Point centre = point(scan.positions[i]);
    b.meeting = oracle::intersect_disc(centre, point(scan.normals[i]), scan.radii[i], o, d);
    extend(centre);
    size = scan.radii[i];
    reach += size;
  } else {
    oracle::Point p[3];
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = point(scan.positions[scan.triangles[i][k]]);
      extend(p[k]);
    }
    b.meeting = oracle::intersect_triangle(p[0], p[1], p[2], o, d);
    const oracle::Point n = oracle::cross(oracle::sub(p[1], p[0]), oracle::sub(p[2], p[0]));
    for (std::size_t k = 0; k < 3; ++k) {
      const oracle::Point e = oracle::sub(p[(k + 1) % 3], p[k]);
      longest = std::max(longest, std::sqrt(oracle::dot(e, e)));
    }
    size = std::sqrt(oracle::dot(n, n)) / longest;  // least altitude
  }
  if (!b.meeting.crosses || !(reach < 1e30)) return std::nullopt;
  const double cosine = std::abs(oracle::dot(b.meeting.normal, d)) / length;
  b.inside_error = std::max(1e-6, kRounding * reach / (size * cosine));
  // t is weighed from the corners, so the weights' errors count by the triangle's length.
  b.t_error = kRounding * reach * std::max(1.0, longest / size) / (cosine * length);
  return b;
}

}  // namespace rbvh
