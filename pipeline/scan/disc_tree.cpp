#include "pipeline/scan/disc_tree.h"

#include <algorithm>
#include <cmath>

namespace rbvh {
namespace {

/// How far a surface lies off the planes of its discs, in their radii.
constexpr float kThickness = 0.5f;

}  // namespace

DiscTree::DiscTree(const Scan& cloud, std::span<const std::uint32_t> discs)
    : cloud_(cloud), order_(discs.begin(), discs.end()), largest_(discs.size()), axes_(discs.size()) {
  build({0, order_.size()});
}

void DiscTree::build(Range range) {
  if (range.first == range.last) return;
  Bounds3f box;
  float largest = 0;
  for (std::size_t i = range.first; i < range.last; ++i) {
    box.add(cloud_.positions[order_[i]]);
    largest = std::max(largest, cloud_.radii[order_[i]]);
  }
  const Vec3f e = box.extent();
  const int axis = e.x >= e.y && e.x >= e.z ? 0 : e.y >= e.z ? 1 : 2;
  const std::size_t middle = (range.first + range.last) / 2;
  const auto at = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(range.first), at(middle), at(range.last), [&](std::uint32_t a, std::uint32_t b) {
    return cloud_.positions[a][axis] < cloud_.positions[b][axis];
  });
  largest_[middle] = largest;
  axes_[middle] = static_cast<std::uint8_t>(axis);
  build({range.first, middle});
  build({middle + 1, range.last});
}

bool DiscTree::covers(const Vec3f& point, const Vec3f& normal, float beyond) const {
  return covers({0, order_.size()}, point, normal, beyond);
}

bool DiscTree::covers(Range range, const Vec3f& point, const Vec3f& normal, float beyond) const {
  if (range.first == range.last) return false;
  const std::size_t middle = (range.first + range.last) / 2;
  const std::uint32_t i = order_[middle];
  const Vec3f d = point - cloud_.positions[i], n = normalized(cloud_.normals[i]);
  const float above = dot(d, n), radius = cloud_.radii[i], reach = radius + beyond;
  if (std::abs(above) <= kThickness * radius + beyond && dot(d, d) - above * above <= reach * reach &&
      dot(n, normal) > 0)
    return true;
  const float off = d[axes_[middle]], most = 1.5f * (largest_[middle] + beyond);
  return (off <= most && covers({range.first, middle}, point, normal, beyond)) ||
         (off >= -most && covers({middle + 1, range.last}, point, normal, beyond));
}

}  // namespace rbvh
