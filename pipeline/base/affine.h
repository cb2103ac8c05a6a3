// Affine maps of space: where an instance of an object stands.
#pragma once

#include <array>
#include <cmath>

#include "rbvh/geometry.h"

namespace rbvh {

/// Rows of a 3 x 4 matrix: p' = m[0..2] . p + m[3], and so on. The identity unless set.
struct Affine {
  std::array<double, 12> m = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  constexpr bool operator==(const Affine&) const = default;

  Vec3d vector(Vec3d v) const {
    return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[4] * v.x + m[5] * v.y + m[6] * v.z,
            m[8] * v.x + m[9] * v.y + m[10] * v.z};
  }
  Vec3d point(Vec3d p) const { return vector(p) + Vec3d{m[3], m[7], m[11]}; }
  /// What becomes of a plane's normal under the *inverse* of this map.
  Vec3d transposed(Vec3d n) const {
    return {m[0] * n.x + m[4] * n.y + m[8] * n.z, m[1] * n.x + m[5] * n.y + m[9] * n.z,
            m[2] * n.x + m[6] * n.y + m[10] * n.z};
  }
  double determinant() const {
    return dot(Vec3d{m[0], m[4], m[8]}, cross(Vec3d{m[1], m[5], m[9]}, Vec3d{m[2], m[6], m[10]}));
  }
  bool is_finite() const {
    for (const double x : m)
      if (!std::isfinite(x)) return false;
    return true;
  }
};

/// First b, then a.
inline Affine operator*(const Affine& a, const Affine& b) {
  Affine c;
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 4; ++column) {
      double sum = column == 3 ? a.m[4 * row + 3] : 0;
      for (std::size_t k = 0; k < 3; ++k) sum += a.m[4 * row + k] * b.m[4 * k + column];
      c.m[4 * row + column] = sum;
    }
  return c;
}

/// Of a map whose determinant is not 0.
inline Affine inverse(const Affine& a) {
  const Vec3d x = {a.m[0], a.m[4], a.m[8]}, y = {a.m[1], a.m[5], a.m[9]}, z = {a.m[2], a.m[6], a.m[10]};
  const double scale = 1 / a.determinant();
  const Vec3d rows[3] = {cross(y, z) * scale, cross(z, x) * scale, cross(x, y) * scale};
  const Vec3d offset = {a.m[3], a.m[7], a.m[11]};
  Affine b;
  for (std::size_t row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      b.m[4 * row + static_cast<std::size_t>(column)] = rows[row][column];
    b.m[4 * row + 3] = -dot(rows[row], offset);
  }
  return b;
}

/// The box around a box's image.
inline Bounds3d transformed(const Affine& a, const Bounds3d& box) {
  Bounds3d image;
  if (box.empty()) return image;
  for (int corner = 0; corner < 8; ++corner)
    image.add(a.point({corner & 1 ? box.hi.x : box.lo.x, corner & 2 ? box.hi.y : box.lo.y,
                       corner & 4 ? box.hi.z : box.lo.z}));
  return image;
}

}  // namespace rbvh
