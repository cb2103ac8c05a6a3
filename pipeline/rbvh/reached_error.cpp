#include "pipeline/rbvh/reached_error.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/point_query.h"
#include "pipeline/rbvh/texel.h"

namespace rbvh {
namespace {

constexpr std::size_t kSamples = 1 << 14;

}  // namespace

double sampled_error(const Device& device, const Level& level, const Scan& scan) {
  const std::size_t count = scan.is_cloud() ? scan.positions.size() : scan.triangles.size();
  const std::size_t step = std::max<std::size_t>(1, count / kSamples);
  std::vector<Vec3f> points;
  std::vector<double> weights;
  for (std::size_t i = 0; i < count; i += step) {
    if (scan.is_cloud()) {
      points.push_back(scan.positions[i]);
      weights.push_back(1);
      continue;
    }
    const Triangle& t = scan.triangles[i];
    const Vec3f a = scan.positions[t[0]], b = scan.positions[t[1]], c = scan.positions[t[2]];
    // The R2 sequence (Roberts 2018), folded into the triangle: centroids of a rough scan lie closer.
    double u = std::fmod(0.7548776662466927 * static_cast<double>(i + 1), 1.0);
    double v = std::fmod(0.5698402909980532 * static_cast<double>(i + 1), 1.0);
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    points.push_back(a + (b - a) * static_cast<float>(u) + (c - a) * static_cast<float>(v));
    weights.push_back(static_cast<double>(length(cross(b - a, c - a))));
  }
  std::vector<const RbvhNode*> boxes(level.leaves.size());
  for (const RbvhNode& node : level.nodes)
    if (node.count != 0) boxes[node.first] = &node;
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  // Texels past a leaf's box serve interpolation, and rays do not find them.
  const auto is_surface = [&](Vec3f point, const PointHit& hit) {
    if (firsts[hit.leaf] != RBVH_NO_LEAF) return true;
    const TileFrame frame(level.leaves[hit.leaf]);
    const auto at = point + static_cast<Vec3f>(normalized(frame.w)) * hit.distance;
    const auto border = static_cast<float>(length(frame.w));
    for (int axis = 0; axis < 3; ++axis)
      if (at[axis] < boxes[hit.leaf]->lo[axis] - border || at[axis] > boxes[hit.leaf]->hi[axis] + border)
        return false;
    return true;
  };
  const double beside = texel_side(level);
  const PointHits hits = query_points(make_point_index(device, level), points);
  double squares = 0, all = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    double nearest = beside;
    for (const PointHit& hit : hits.of(i))
      if (is_surface(points[i], hit))
        nearest = std::min(nearest, std::abs(static_cast<double>(hit.distance)));
    squares += weights[i] * nearest * nearest;
    all += weights[i];
  }
  return all > 0 ? std::sqrt(squares / all) : 0;
}

}  // namespace rbvh
