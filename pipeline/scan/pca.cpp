#include "pipeline/scan/pca.h"

#include <numbers>

namespace rbvh {
namespace {

Vec3d perpendicular(Vec3d v) {
  const Vec3d axis = std::abs(v.x) <= std::abs(v.y) && std::abs(v.x) <= std::abs(v.z) ? Vec3d{1, 0, 0}
                     : std::abs(v.y) <= std::abs(v.z)                                 ? Vec3d{0, 1, 0}
                                                                                      : Vec3d{0, 0, 1};
  return normalized(cross(v, axis));
}

Vec3d longest(Vec3d a, Vec3d b, Vec3d c) {
  const double la = dot(a, a), lb = dot(b, b), lc = dot(c, c);
  return la >= lb && la >= lc ? a : lb >= lc ? b : c;
}

}  // namespace

PrincipalComponents principal_components(std::span<const Vec3f> points, std::size_t self,
                                         std::span<const std::uint32_t> others) {
  // Around the point itself, which keeps digits where coordinates are large against the neighbourhood.
  const Vec3d origin = static_cast<Vec3d>(points[self]);
  Vec3d sum;
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
  for (const std::uint32_t other : others) {
    const Vec3d d = static_cast<Vec3d>(points[other]) - origin;
    sum = sum + d;
    xx += d.x * d.x;
    xy += d.x * d.y;
    xz += d.x * d.z;
    yy += d.y * d.y;
    yz += d.y * d.z;
    zz += d.z * d.z;
  }
  const double scale = 1.0 / static_cast<double>(others.size() + 1);
  const Vec3d mean = sum * scale;
  xx = xx * scale - mean.x * mean.x;
  xy = xy * scale - mean.x * mean.y;
  xz = xz * scale - mean.x * mean.z;
  yy = yy * scale - mean.y * mean.y;
  yz = yz * scale - mean.y * mean.z;
  zz = zz * scale - mean.z * mean.z;

  PrincipalComponents result;
  const double third = (xx + yy + zz) / 3;
  if (!(third > 0)) return result;
  // Eigenvalues by the trigonometric solution of the cubic, of the matrix divided by its mean variance.
  const double s = 1 / third;
  const double a = xx * s - 1, b = yy * s - 1, c = zz * s - 1, d = xy * s, e = xz * s, f = yz * s;
  const double p = std::sqrt((a * a + b * b + c * c + 2 * (d * d + e * e + f * f)) / 6);
  double least = 0, middle = 0, largest = 0;
  if (p > 1e-12) {
    const double determinant = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e);
    const double angle = std::acos(std::clamp(determinant / (2 * p * p * p), -1.0, 1.0)) / 3;
    largest = 2 * p * std::cos(angle);
    least = 2 * p * std::cos(angle + 2 * std::numbers::pi / 3);
    middle = -largest - least;
  }
  result.variances = {std::max(0.0, (least + 1) * third), std::max(0.0, (middle + 1) * third),
                      (largest + 1) * third};

  // The rows of (matrix - least) span the plane across the normal; on a line only a line.
  const Vec3d r0{a - least, d, e}, r1{d, b - least, f}, r2{e, f, c - least};
  const Vec3d n = longest(cross(r0, r1), cross(r1, r2), cross(r2, r0));
  const double spread = largest - least;
  if (dot(n, n) > 1e-16 * spread * spread * spread * spread) {
    result.normal = normalized(n);
  } else if (spread > 1e-12) {
    result.normal = perpendicular(longest(r0, r1, r2));
  }
  return result;
}

}  // namespace rbvh
