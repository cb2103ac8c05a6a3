// Brute force in double precision: a ray against every primitive. Shares no code with the tracers.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace rbvh::oracle {

using Point = std::array<double, 3>;

inline Point sub(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Point cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Where a ray crosses one primitive's plane.
struct Meeting {
  bool crosses = false;  ///< the plane, at a definite t
  double t = 0;
  double inside =
      0;  ///< triangle: least barycentric coordinate; disc: 1 - distance / radius. Not negative: a hit
  double u = 0, v = 0;
  Point normal{};  ///< unit
};

/// Moeller-Trumbore.
inline Meeting intersect_triangle(const Point& a, const Point& b, const Point& c, const Point& o,
                                  const Point& d) {
  Meeting m;
  const Point ab = sub(b, a), ac = sub(c, a), n = cross(ab, ac);
  const double area = std::sqrt(dot(n, n)), length = std::sqrt(dot(d, d));
  const Point p = cross(d, ac);
  const double det = dot(ab, p);
  if (!(area > 0) || !(std::abs(det) > 1e-12 * area * length)) return m;  // edge-on
  const Point s = sub(o, a), q = cross(s, ab);
  m.crosses = true;
  m.u = dot(s, p) / det;
  m.v = dot(d, q) / det;
  m.t = dot(ac, q) / det;
  m.inside = std::min({m.u, m.v, 1 - m.u - m.v});
  m.normal = {n[0] / area, n[1] / area, n[2] / area};
  return m;
}

inline Meeting intersect_disc(const Point& centre, const Point& normal, double radius, const Point& o,
                              const Point& d) {
  Meeting m;
  const double n = std::sqrt(dot(normal, normal)), slope = dot(normal, d);
  if (!(n > 0) || !(radius > 0) || !(std::abs(slope) > 1e-12 * n * std::sqrt(dot(d, d)))) return m;
  m.crosses = true;
  m.t = dot(normal, sub(centre, o)) / slope;
  const Point r = {o[0] + m.t * d[0] - centre[0], o[1] + m.t * d[1] - centre[1],
                   o[2] + m.t * d[2] - centre[2]};
  m.inside = 1 - std::sqrt(dot(r, r)) / radius;
  m.normal = {normal[0] / n, normal[1] / n, normal[2] / n};
  return m;
}

}  // namespace rbvh::oracle
