#include "pipeline/rbvh/reached_error.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/base/parallel_for.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/point_query.h"
#include "pipeline/rbvh/texel.h"

namespace rbvh {
namespace {

constexpr std::size_t kSamples = 1 << 14;
constexpr std::size_t kGrain = 1 << 9;  // of these

struct Samples {
  std::vector<Vec3f> points;
  std::vector<double> weights;
};

Samples sample(const Scan& scan) {
  const std::size_t count = scan.is_cloud() ? scan.positions.size() : scan.triangles.size();
  const std::size_t step = std::max<std::size_t>(1, count / kSamples);
  Samples samples;
  for (std::size_t i = 0; i < count; i += step) {
    if (scan.is_cloud()) {
      samples.points.push_back(scan.positions[i]);
      samples.weights.push_back(1);
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
    samples.points.push_back(a + (b - a) * static_cast<float>(u) + (c - a) * static_cast<float>(v));
    samples.weights.push_back(static_cast<double>(length(cross(b - a, c - a))));
  }
  return samples;
}

float distance_to_box(Vec3f p, Vec3f lo, Vec3f hi) {
  Vec3f beside;
  for (int axis = 0; axis < 3; ++axis)
    beside[axis] = std::max({0.0f, lo[axis] - p[axis], p[axis] - hi[axis]});
  return length(beside);
}

/// From the point to the nearest of the level's primitives, at most `most`.
float distance_to_primitives(const Level& level, std::span<const std::uint32_t> firsts, Vec3f point,
                             float most) {
  std::vector<std::uint32_t> open = {0};
  while (!open.empty()) {
    const RbvhNode& node = level.nodes[open.back()];
    open.pop_back();
    const Vec3f lo{node.lo[0], node.lo[1], node.lo[2]}, hi{node.hi[0], node.hi[1], node.hi[2]};
    if (!(distance_to_box(point, lo, hi) < most)) continue;
    if (node.count == 0) {
      open.push_back(node.first);
      open.push_back(node.first + 1);
      continue;
    }
    const std::uint32_t first = firsts[node.first];
    if (first == RBVH_NO_LEAF) continue;
    for (std::uint32_t i = first; i < first + level.leaves[node.first].primitives; ++i) {
      const Bounds3f box = primitive_bounds(level.primitives, i);
      if (distance_to_box(point, box.lo, box.hi) < most)
        most = std::min(most, nearest_primitive(level, i, 1, point).distance);
    }
  }
  return most;
}

/// Lessens the distances to those from the tiles.
void approach_tiles(const Device& device, const Level& level, std::span<const std::uint32_t> firsts,
                    std::span<const Vec3f> points, std::vector<float>& distances) {
  std::vector<const RbvhNode*> boxes(level.leaves.size());
  for (const RbvhNode& node : level.nodes)
    if (node.count != 0) boxes[node.first] = &node;
  // Texels past a leaf's box serve interpolation, and rays do not find them.
  const auto is_surface = [&](Vec3f point, const PointHit& hit) {
    const TileFrame frame(level.leaves[hit.leaf]);
    const auto at = point + static_cast<Vec3f>(normalized(frame.w)) * hit.distance;
    const auto border = static_cast<float>(length(frame.w));
    for (int axis = 0; axis < 3; ++axis)
      if (at[axis] < boxes[hit.leaf]->lo[axis] - border || at[axis] > boxes[hit.leaf]->hi[axis] + border)
        return false;
    return true;
  };
  const PointHits hits = query_points(make_point_index(device, level), points);
  for (std::size_t i = 0; i < points.size(); ++i)
    for (const PointHit& hit : hits.of(i))
      if (firsts[hit.leaf] == RBVH_NO_LEAF && is_surface(points[i], hit))
        distances[i] = std::min(distances[i], std::abs(hit.distance));
}

}  // namespace

double sampled_error(const Device& device, const Level& level, const Scan& scan) {
  const Samples samples = sample(scan);
  const std::vector<Vec3f>& points = samples.points;
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  std::vector<float> distances(points.size());
  const auto beside = static_cast<float>(texel_side(level));
  parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      distances[i] = distance_to_primitives(level, firsts, points[i], beside);
  });
  if (level.primitive_leaves.size() < level.leaves.size())
    approach_tiles(device, level, firsts, points, distances);
  double squares = 0, all = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto distance = static_cast<double>(distances[i]);
    squares += samples.weights[i] * distance * distance;
    all += samples.weights[i];
  }
  return all > 0 ? std::sqrt(squares / all) : 0;
}

}  // namespace rbvh
