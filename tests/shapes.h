// Small meshes for tests.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>

#include "rbvh/scan.h"

namespace rbvh {

/// Two triangles a cell over a grid of columns x rows cells; `place` maps (s, t) in [0,1]^2 to a point.
/// Appended.
inline void add_sheet(Scan& scan, int columns, int rows,
                      const std::function<Vec3f(float s, float t)>& place) {
  const auto first = static_cast<std::uint32_t>(scan.positions.size());
  const auto side = static_cast<std::uint32_t>(columns) + 1;
  for (int j = 0; j <= rows; ++j)
    for (int i = 0; i <= columns; ++i)
      scan.positions.push_back(place(static_cast<float>(i) / static_cast<float>(columns),
                                     static_cast<float>(j) / static_cast<float>(rows)));
  for (std::uint32_t j = 0; j < static_cast<std::uint32_t>(rows); ++j)
    for (std::uint32_t i = 0; i + 1 < side; ++i) {
      const std::uint32_t a = first + j * side + i;
      scan.triangles.push_back({a, a + 1, a + side});
      scan.triangles.push_back({a + 1, a + side + 1, a + side});
    }
}

/// The same of n x n cells.
inline void add_sheet(Scan& scan, int n, const std::function<Vec3f(float s, float t)>& place) {
  add_sheet(scan, n, n, place);
}

/// A horizontal square of side 1 at height z, centred on the z axis, facing up (or down).
inline void add_plate(Scan& scan, int n, float z, bool up = true) {
  add_sheet(scan, n, [=](float s, float t) {
    return up ? Vec3f{s - 0.5f, t - 0.5f, z} : Vec3f{t - 0.5f, s - 0.5f, z};
  });
}

/// A bumpy unit sphere, closed up to its poles.
inline Scan bumpy_sphere(int n, float bump = 0.05f) {
  Scan scan;
  add_sheet(scan, n, [=](float s, float t) {
    const float phi = 6.2831853f * s, theta = 3.14159265f * (1 - t);
    const float r = 1 + bump * std::sin(5 * phi) * std::sin(theta) * std::sin(4 * theta);
    return Vec3f{r * std::sin(theta) * std::cos(phi), r * std::sin(theta) * std::sin(phi),
                 r * std::cos(theta)};
  });
  return scan;
}

}  // namespace rbvh
