// Parts thinner than a level's error: plates, fins, leaves, shells and wires keep their extent at all levels.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "pipeline/measure/surface_distance.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/level_mesh.h"
#include "pipeline/scan/clean.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

constexpr float kPi = 3.14159265f;

/// A closed surface of revolution about z; `profile` maps [0, 1] to (radius, height). Welded.
Scan turned(int around, int along, const std::function<std::array<float, 2>(float)>& profile) {
  Scan scan;
  const auto n = static_cast<std::uint32_t>(around);
  for (int j = 0; j <= along; ++j)
    for (int i = 0; i < around; ++i) {
      const auto [r, z] = profile(static_cast<float>(j) / static_cast<float>(along));
      const float phi = 2 * kPi * static_cast<float>(i) / static_cast<float>(around);
      scan.positions.push_back({r * std::cos(phi), r * std::sin(phi), z});
    }
  for (std::uint32_t j = 0; j < static_cast<std::uint32_t>(along); ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = j * n + i, b = j * n + (i + 1) % n;
      scan.triangles.push_back({a, b, b + n});
      scan.triangles.push_back({a, b + n, a + n});
    }
  clean(scan);
  return scan;
}

/// A path of points given by their places along it.
std::function<std::array<float, 2>(float)> polyline(std::vector<std::array<float, 2>> points) {
  return [points](float s) {
    const float at = s * static_cast<float>(points.size() - 1);
    const auto k = std::min(static_cast<std::size_t>(at), points.size() - 2);
    const float f = at - static_cast<float>(k);
    return std::array{points[k][0] * (1 - f) + points[k + 1][0] * f,
                      points[k][1] * (1 - f) + points[k + 1][1] * f};
  };
}

/// A square plate with walls.
Scan square_plate(float thickness) {
  Scan scan;
  add_plate(scan, 40, 0.5f * thickness);
  add_plate(scan, 40, -0.5f * thickness, false);
  for (int side = 0; side < 4; ++side)
    add_sheet(scan, 40, [=](float s, float t) {
      const float c = side % 2 == 0 ? 1 : 0, d = side < 2 ? 1 : -1;
      const float x = d * 0.5f, y = d * (s - 0.5f), z = (t - 0.5f) * thickness;
      return Vec3f{c * x - (1 - c) * y, (1 - c) * x + c * y, z};
    });
  for (Vec3f& p : scan.positions)
    for (const int axis : {0, 1}) p[axis] = std::round(p[axis] * 4096) / 4096;
  clean(scan);
  return scan;
}

Scan disc_plate(float thickness) {
  const float h = 0.5f * thickness;
  return turned(96, 60, polyline({{0, -h}, {0.5f, -h}, {0.5f, h}, {0, h}}));
}

Scan lens(float thickness) {
  const float h = 0.5f * thickness;
  return turned(96, 40, polyline({{0, -h}, {0.5f, 0}, {0, h}}));
}

/// With a round rim.
Scan coin(float thickness) {
  const float h = 0.5f * thickness;
  return turned(96, 60, [=](float s) {
    if (s < 0.35f) return std::array{0.5f * s / 0.35f, -h};
    if (s > 0.65f) return std::array{0.5f * (1 - s) / 0.35f, h};
    const float angle = kPi * (s - 0.35f) / 0.3f - 0.5f * kPi;
    return std::array{0.5f + h * std::cos(angle), h * std::sin(angle)};
  });
}

Scan cup(float thickness) {
  const float t = thickness;
  return turned(96, 90,
                polyline({{0, 0}, {0.3f, 0}, {0.4f, 1}, {0.4f - t, 1}, {0.3f - t, t}, {0.15f, t}, {0, t}}));
}

Scan helix_wire(float thickness, std::uint32_t sides) {
  Scan scan;
  constexpr std::uint32_t n = 400;
  for (std::uint32_t i = 0; i <= n; ++i) {
    const float s = static_cast<float>(i) / n, phi = 6 * kPi * s;
    const Vec3f c{0.4f * std::cos(phi), 0.4f * std::sin(phi), s};
    const Vec3f out{std::cos(phi), std::sin(phi), 0}, up{0, 0, 1};
    for (std::uint32_t k = 0; k < sides; ++k) {
      const float angle = 2 * kPi * static_cast<float>(k) / static_cast<float>(sides);
      scan.positions.push_back(c + (out * std::cos(angle) + up * std::sin(angle)) * (0.5f * thickness));
    }
  }
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t k = 0; k < sides; ++k) {
      const std::uint32_t a = i * sides + k, b = i * sides + (k + 1) % sides;
      scan.triangles.push_back({a, b, b + sides});
      scan.triangles.push_back({a, b + sides, a + sides});
    }
  for (std::uint32_t k = 1; k + 1 < sides; ++k) {
    scan.triangles.push_back({0, k + 1, k});
    scan.triangles.push_back({n * sides, n * sides + k, n * sides + k + 1});
  }
  return scan;
}

/// A leaf's blade, open, or of two sides `thickness` apart that meet along its rim.
Scan leaf(float thickness, bool two_sided) {
  Scan scan;
  const auto blade = [=](float side) {
    return [=](float s, float t) {
      const float wide = 0.3f * std::sin(kPi * s);
      const float x = (2 * t - 1) * wide, mid = 1 - (2 * t - 1) * (2 * t - 1);
      return Vec3f{side < 0 ? -x : x, s,
                   0.2f * s * s + 0.3f * x * x + 0.5f * side * thickness * mid * std::sin(kPi * s)};
    };
  };
  add_sheet(scan, 48, blade(1));
  if (two_sided) add_sheet(scan, 48, blade(-1));
  clean(scan);
  return scan;
}

/// A ball with a fin of two sides on it; its sides are divided differently.
Scan ball_with_fin(float thickness) {
  Scan scan = bumpy_sphere(60, 0.0f);
  for (const int side : {0, 1}) {
    add_sheet(scan, side == 0 ? 30 : 22, [=](float s, float t) {
      const float h = 0.5f * thickness * (1 - t);
      const float x = side == 0 ? 2 * s - 1 : 1 - 2 * s;
      return Vec3f{0.5f * x, side == 0 ? -h : h, 0.8f + t};
    });
  }
  clean(scan);
  return scan;
}

/// Of the levels' errors: what distances may be, rms and most.
struct Limit {
  double rms = 1, most = 6;
};

void expect_kept(const Scan& scan, const std::string& what, Limit limit = {}) {
  static const Device device = Device::open();
  const TriangleSoup surface = surface_of(scan);
  const auto diagonal = static_cast<double>(bounds(scan).diagonal());
  BuildConfig build;
  build.hybrid = Hybrid::kAlways;
  // All levels, each made from the one before, and the coarsest one alone.
  for (const std::vector<LevelConfig>& levels : {standard_levels(), standard_levels({"Q4"})}) {
    build.levels = levels;
    for (const Level& level : build_rbvh(device, scan, build).levels) {
      const ClosestPoint kept(surface_of(level_mesh(level, false)));
      const DistanceStatistics distance = sampled_distance(surface, kept, 6000);
      const double error = static_cast<double>(level.error) * diagonal;
      EXPECT_LT(distance.rms, limit.rms * error) << level.name << " of " << what;
      EXPECT_LT(distance.max, limit.most * error) << level.name << " of " << what;
    }
  }
}

constexpr std::array kThicknesses = {0.0f, 1e-5f, 1e-4f, 1e-3f};

std::string of(float thickness) { return " of " + std::to_string(thickness); }

TEST(ThinParts, SquarePlates) {
  for (const float thickness : kThicknesses) expect_kept(square_plate(thickness), "square" + of(thickness));
}

TEST(ThinParts, DiscsWithRimsOfManyKinds) {
  for (const float thickness : kThicknesses) {
    expect_kept(disc_plate(thickness), "disc" + of(thickness));
    expect_kept(lens(thickness), "lens" + of(thickness));
    if (thickness > 0) expect_kept(coin(thickness), "coin" + of(thickness));
  }
}

TEST(ThinParts, Shells) {
  for (const float thickness : kThicknesses) expect_kept(cup(thickness), "cup" + of(thickness));
}

TEST(ThinParts, Leaves) {
  for (const float thickness : kThicknesses) {
    expect_kept(leaf(thickness, false), "open leaf" + of(thickness));
    expect_kept(leaf(thickness, true), "leaf" + of(thickness));
  }
}

TEST(ThinParts, Fins) {
  for (const float thickness : kThicknesses) expect_kept(ball_with_fin(thickness), "fin" + of(thickness));
}

TEST(ThinParts, Wires) {
  for (const std::uint32_t sides : {3u, 4u, 8u}) {
    const std::string wire = std::to_string(sides) + "-sided wire";
    // Thinner than the lattice of Q4, where an end may lose a segment.
    expect_kept(helix_wire(1e-4f, sides), wire + of(1e-4f), {1, 25});
    for (const float thickness : {1e-3f, 1e-2f})
      expect_kept(helix_wire(thickness, sides), wire + of(thickness));
  }
}

}  // namespace
}  // namespace rbvh
