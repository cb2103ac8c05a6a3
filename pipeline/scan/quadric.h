// Sums of squared distances from planes or lines (Garland and Heckbert 1997), in doubles.
#pragma once

#include <algorithm>
#include <optional>

#include "rbvh/geometry.h"

namespace rbvh {

/// By weight.
struct Quadric {
  double xx = 0, yy = 0, zz = 0, xy = 0, yz = 0, zx = 0, x = 0, y = 0, z = 0, constant = 0, weight = 0;

  void operator+=(const Quadric& q) {
    xx += q.xx, yy += q.yy, zz += q.zz, xy += q.xy, yz += q.yz, zx += q.zx;
    x += q.x, y += q.y, z += q.z, constant += q.constant, weight += q.weight;
  }
  /// The mean over what was added.
  double at(Vec3d p) const {
    if (!(weight > 0)) return 0;
    const double sum = p.x * (xx * p.x + 2 * (xy * p.y + x)) + p.y * (yy * p.y + 2 * (yz * p.z + y)) +
                       p.z * (zz * p.z + 2 * (zx * p.x + z)) + constant;
    return std::max(0.0, sum / weight);
  }
  /// The place of the least value, where a square distance from `p` of weight `hold` times all is added.
  std::optional<Vec3d> least_near(Vec3d p, double hold) const {
    const double a = xx + hold * weight, b = yy + hold * weight, c = zz + hold * weight;
    const Vec3d r{-(xx * p.x + xy * p.y + zx * p.z + x), -(xy * p.x + yy * p.y + yz * p.z + y),
                  -(zx * p.x + yz * p.y + zz * p.z + z)};
    // Cramer's rule, with the cofactors of a symmetric matrix.
    const double f = b * c - yz * yz, g = zx * yz - xy * c, h = xy * yz - b * zx;
    const double determinant = a * f + xy * g + zx * h;
    if (!(determinant > 0)) return {};
    const double i = a * c - zx * zx, j = xy * zx - a * yz, k = a * b - xy * xy;
    return p + Vec3d{f * r.x + g * r.y + h * r.z, g * r.x + i * r.y + j * r.z, h * r.x + j * r.y + k * r.z} *
                   (1 / determinant);
  }
};

/// From the plane through `p` with unit normal `n`.
inline Quadric plane_quadric(Vec3d n, Vec3d p, double w) {
  const double d = -dot(n, p);
  return {w * n.x * n.x,
          w * n.y * n.y,
          w * n.z * n.z,
          w * n.x * n.y,
          w * n.y * n.z,
          w * n.z * n.x,
          w * n.x * d,
          w * n.y * d,
          w * n.z * d,
          w * d * d,
          w};
}

/// From the line through `p` along unit `u`.
inline Quadric line_quadric(Vec3d u, Vec3d p, double w) {
  const Vec3d q = u * dot(u, p) - p;  // A p = p - u (u p), and b = -A p
  return {w * (1 - u.x * u.x),
          w * (1 - u.y * u.y),
          w * (1 - u.z * u.z),
          -w * u.x * u.y,
          -w * u.y * u.z,
          -w * u.z * u.x,
          w * q.x,
          w * q.y,
          w * q.z,
          -w * dot(q, p),
          w};
}

}  // namespace rbvh
