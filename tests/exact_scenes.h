// Scans and rays that break ray tracers.
#pragma once

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "kernels/common/layout.h"
#include "rbvh/scan.h"
#include "tests/oracle.h"

namespace rbvh {

inline constexpr float kInfinity = std::numeric_limits<float>::infinity();
inline constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

using Random = std::mt19937_64;

inline oracle::Point point(const Vec3f& v) { return {v.x, v.y, v.z}; }

inline float uniform(Random& random, float lo, float hi) {
  return std::uniform_real_distribution<float>(lo, hi)(random);
}

inline Vec3f uniform_point(Random& random, float half) {
  return {uniform(random, -half, half), uniform(random, -half, half), uniform(random, -half, half)};
}

inline Vec3f uniform_direction(Random& random) {
  std::normal_distribution<float> normal;
  return normalized(Vec3f{normal(random), normal(random), normal(random)});
}

inline Ray make_ray(Vec3f o, Vec3f d, float tmin = 0, float tmax = kInfinity) {
  return {{o.x, o.y, o.z}, tmin, {d.x, d.y, d.z}, tmax};
}

// --- scenes
// ---------------------------------------------------------------------------------------------------------

inline void add_triangle(Scan& scan, Vec3f a, Vec3f b, Vec3f c) {
  const auto first = static_cast<std::uint32_t>(scan.positions.size());
  for (const Vec3f& p : {a, b, c}) scan.positions.push_back(p);
  scan.triangles.push_back({first, first + 1, first + 2});
}

inline Scan soup(Random& random, std::size_t count, float size) {
  Scan scan;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f at = uniform_point(random, 1);
    add_triangle(scan, at + uniform_point(random, size), at + uniform_point(random, size),
                 at + uniform_point(random, size));
  }
  return scan;
}

inline Scan discs(Random& random, std::size_t count, float radius) {
  Scan scan;
  for (std::size_t i = 0; i < count; ++i) {
    scan.positions.push_back(uniform_point(random, 1));
    scan.normals.push_back(uniform_direction(random) * uniform(random, 0.5f, 2));
    scan.radii.push_back(uniform(random, 0.2f, 1) * radius);
  }
  return scan;
}

/// A flat n x n grid of squares in the plane z = height, each two triangles.
inline Scan grid(int n, float height) {
  Scan scan;
  for (int y = 0; y <= n; ++y) {
    for (int x = 0; x <= n; ++x)
      scan.positions.push_back({static_cast<float>(x), static_cast<float>(y), height});
  }
  const auto id = [n](int x, int y) { return static_cast<std::uint32_t>(y * (n + 1) + x); };
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      scan.triangles.push_back({id(x, y), id(x + 1, y), id(x + 1, y + 1)});
      scan.triangles.push_back({id(x, y), id(x + 1, y + 1), id(x, y + 1)});
    }
  }
  return scan;
}

/// A closed, bumpy globe around the origin.
inline Scan globe(Random& random, int rings, int segments) {
  Scan scan;
  scan.positions.push_back({0, 0, 1});
  for (int r = 1; r < rings; ++r) {
    for (int s = 0; s < segments; ++s) {
      const float theta = std::numbers::pi_v<float> * static_cast<float>(r) / static_cast<float>(rings);
      const float phi = 2 * std::numbers::pi_v<float> * static_cast<float>(s) / static_cast<float>(segments);
      const float radius = uniform(random, 0.95f, 1.05f);
      scan.positions.push_back(
          Vec3f{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)} * radius);
    }
  }
  scan.positions.push_back({0, 0, -1});
  const auto last = static_cast<std::uint32_t>(scan.positions.size() - 1);
  const auto id = [&](int r, int s) {
    return static_cast<std::uint32_t>(1 + (r - 1) * segments + s % segments);
  };
  for (int s = 0; s < segments; ++s) {
    scan.triangles.push_back({0, id(1, s), id(1, s + 1)});
    scan.triangles.push_back({last, id(rings - 1, s + 1), id(rings - 1, s)});
    for (int r = 1; r + 1 < rings; ++r) {
      scan.triangles.push_back({id(r, s), id(r + 1, s), id(r + 1, s + 1)});
      scan.triangles.push_back({id(r, s), id(r + 1, s + 1), id(r, s + 1)});
    }
  }
  return scan;
}

/// Long and thin.
inline Scan slivers(Random& random, std::size_t count) {
  Scan scan;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f a = uniform_point(random, 1), b = uniform_point(random, 1);
    add_triangle(scan, a, b, (a + b) * 0.5f + uniform_point(random, 1e-3f));
  }
  return scan;
}

// --- rays
// -----------------------------------------------------------------------------------------------------------

inline std::vector<Ray> random_rays(Random& random, const Scan& scan, std::size_t count) {
  const Bounds3f box = bounds(scan);
  const Vec3f centre = box.empty() ? Vec3f{} : box.center();
  const float size = box.empty() ? 1.0f : std::max(0.5f * box.diagonal(), 0.1f);
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count; ++i) {
    const float far = i % 3 == 0 ? 0.5f : i % 3 == 1 ? 2.0f : 10.0f;
    const Vec3f origin = centre + uniform_direction(random) * (size * far);
    const Vec3f aim = centre + uniform_point(random, 0.6f * size);
    Vec3f direction = aim - origin;
    const std::uint64_t kind = random() % 8;
    if (kind == 0) {  // parallel to one axis or two
      direction[static_cast<int>(random() % 3)] = random() % 2 ? 0.0f : -0.0f;
      if (random() % 2) direction[static_cast<int>(random() % 3)] = random() % 2 ? 0.0f : -0.0f;
    } else if (kind == 1) {  // not of unit length
      direction = direction * std::pow(10.0f, uniform(random, -4, 4));
    } else if (kind == 2) {  // tiny components
      direction[static_cast<int>(random() % 3)] *= 1e-25f;
    }
    Ray ray = make_ray(origin, direction);
    if (kind == 3) {  // an interval that cuts
      ray.tmin = uniform(random, -0.5f, 1);
      ray.tmax = ray.tmin + uniform(random, 0, 1);
    }
    rays.push_back(ray);
  }
  return rays;
}

/// Rays that hit vertices, edges and planes exactly, along the axes and between.
inline std::vector<Ray> exact_rays(Random& random, const Scan& scan, std::size_t count) {
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count && !scan.positions.empty(); ++i) {
    const Vec3f target = scan.positions[random() % scan.positions.size()];
    Vec3f direction{};
    const int axis = static_cast<int>(random() % 3);
    direction[axis] = random() % 2 ? 1.0f : -1.0f;
    if (random() % 3 == 0) direction[(axis + 1) % 3] = random() % 2 ? 1.0f : -1.0f;
    rays.push_back(make_ray(target - direction * static_cast<float>(random() % 8), direction));
  }
  return rays;
}

/// Triangles that are a height field nowhere.
inline Scan thicket(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  return soup(random, count, 0.15f);
}

/// A layer of n x n discs that is none either.
inline Scan noisy_discs(int n, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<float> noise;
  Scan scan;
  for (int i = 0; i < n * n; ++i) {
    const auto place = [&](int k) { return 2.0f * static_cast<float>(k) / static_cast<float>(n) - 1; };
    scan.positions.push_back({place(i % n), place(i / n), 1.5f / static_cast<float>(n) * noise(random)});
    scan.normals.push_back(normalized(Vec3f{0.3f * noise(random), 0.3f * noise(random), 1}));
    scan.radii.push_back(1.6f / static_cast<float>(n));
  }
  return scan;
}

}  // namespace rbvh
