#include "pipeline/bvh/primitive_bounds.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel_for.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 14;

Bounds3f triangle_bounds(const Scan& scan, const Triangle& triangle) {
  const Vec3f &a = scan.positions[triangle[0]], &b = scan.positions[triangle[1]],
              &c = scan.positions[triangle[2]];
  const auto ab = static_cast<Vec3d>(b) - static_cast<Vec3d>(a),
             ac = static_cast<Vec3d>(c) - static_cast<Vec3d>(a);
  const double area = length(cross(ab, ac));
  Bounds3f box;
  if (!(area > 0) || !std::isfinite(area)) return box;
  box.add(a);
  box.add(b);
  box.add(c);
  return box;
}

Bounds3f disc_bounds(const Vec3f& position, const Vec3f& normal, float radius) {
  const Vec3d n = normalized(static_cast<Vec3d>(normal));
  Bounds3f box;
  if (!is_finite(position) || !is_finite(n) || !(dot(n, n) > 0) || !(radius > 0) || !std::isfinite(radius))
    return box;
  const auto half = [&](double along) {  // rounded outwards
    return static_cast<float>(radius * std::sqrt(std::max(0.0, 1.0 - along * along)) * (1 + 1e-6));
  };
  const Vec3f e = {half(n.x), half(n.y), half(n.z)};
  box.add(position - e);
  box.add(position + e);
  return box;
}

}  // namespace

std::vector<Bounds3f> primitive_bounds(const Scan& scan) {
  std::vector<Bounds3f> boxes(scan.is_cloud() ? scan.positions.size() : scan.triangles.size());
  parallel_for(boxes.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      boxes[i] = scan.is_cloud() ? disc_bounds(scan.positions[i], scan.normals[i], scan.radii[i])
                                 : triangle_bounds(scan, scan.triangles[i]);
    }
  });
  return boxes;
}

}  // namespace rbvh
