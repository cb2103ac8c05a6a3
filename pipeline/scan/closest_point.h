// A surface as triangles, and the nearest point on it.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "rbvh/geometry.h"
#include "rbvh/scan.h"

namespace rbvh {

/// Corners of triangles, three after three.
using TriangleSoup = std::vector<Vec3f>;

void add_triangle(TriangleSoup& soup, Vec3f a, Vec3f b, Vec3f c);
/// As an octagon.
void add_disc(TriangleSoup& soup, Vec3f center, Vec3f normal, float radius);

/// A mesh's finite triangles, or a cloud's discs as octagons.
TriangleSoup surface_of(const Scan& scan);
/// Zero inside the box.
inline float squared_distance(const Bounds3f& box, Vec3f p) {
  const Vec3f d{std::max({box.lo.x - p.x, 0.f, p.x - box.hi.x}),
                std::max({box.lo.y - p.y, 0.f, p.y - box.hi.y}),
                std::max({box.lo.z - p.z, 0.f, p.z - box.hi.z})};
  return dot(d, d);
}

/// The weights of a, b, c at the point of their triangle nearest to p.
std::array<float, 3> nearest_weights(Vec3f p, Vec3f a, Vec3f b, Vec3f c);

/// Answers "how far is the nearest point of the surface".
class ClosestPoint {
 public:
  explicit ClosestPoint(TriangleSoup triangles);
  /// +infinity for an empty surface.
  float distance(Vec3f point) const { return find(point).distance; }

  struct Nearest {
    float distance = std::numeric_limits<float>::infinity();
    std::uint32_t triangle = 0;  ///< of the soup
    Vec3f point{};
  };
  Nearest find(Vec3f point) const;

 private:
  struct Node {
    Bounds3f box;
    std::uint32_t first = 0, count = 0;  ///< count 0: children at first and first + 1
  };
  TriangleSoup triangles_;
  std::vector<std::uint32_t> order_;  ///< of triangles_, in the soup
  std::vector<Node> nodes_;
};

}  // namespace rbvh
