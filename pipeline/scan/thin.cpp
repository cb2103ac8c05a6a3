#include "pipeline/scan/thin.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "pipeline/base/error.h"
#include "pipeline/scan/compact.h"

namespace rbvh {
namespace {

using Voxel = std::array<std::int64_t, 3>;

}  // namespace

std::size_t thin_cloud(Scan& scan, double size) {
  RBVH_CHECK(size > 0 && scan.is_cloud());
  const std::vector<Vec3f>& points = scan.positions;
  const Vec3d low = static_cast<Vec3d>(bounds(scan).lo);
  std::vector<Voxel> voxels(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3d cell = (static_cast<Vec3d>(points[i]) - low) * (1 / size);
    for (int axis = 0; axis < 3; ++axis)
      voxels[i][static_cast<std::size_t>(axis)] = static_cast<std::int64_t>(std::min(cell[axis], 9e18));
  }
  std::vector<std::uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return voxels[a] != voxels[b] ? voxels[a] < voxels[b] : a < b;
  });

  std::vector<std::uint8_t> keep(points.size(), 0);
  std::size_t kept = 0;
  for (std::size_t first = 0, last; first < order.size(); first = last) {
    Vec3d sum;
    for (last = first; last < order.size() && voxels[order[last]] == voxels[order[first]]; ++last)
      sum = sum + static_cast<Vec3d>(points[order[last]]);
    const Vec3d mean = sum * (1.0 / static_cast<double>(last - first));
    const auto nearest = std::min_element(
        order.begin() + static_cast<std::ptrdiff_t>(first), order.begin() + static_cast<std::ptrdiff_t>(last),
        [&](std::uint32_t a, std::uint32_t b) {
          return length(static_cast<Vec3d>(points[a]) - mean) < length(static_cast<Vec3d>(points[b]) - mean);
        });
    keep[*nearest] = 1;
    ++kept;
  }
  const std::size_t gone = points.size() - kept;
  keep_vertices(scan, keep);
  if (gone > 0) scan.radii.clear();
  return gone;
}

}  // namespace rbvh
