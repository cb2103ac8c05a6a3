#include "pipeline/measure/surface_distance.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/rbvh/tile.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kLeafTriangles = 4;
constexpr int kDiscCorners = 8;

// Ericson, Real-Time Collision Detection, 5.1.5.
Vec3f closest_on_triangle(Vec3f p, Vec3f a, Vec3f b, Vec3f c) {
  const Vec3f ab = b - a, ac = c - a, ap = p - a;
  const float d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Vec3f bp = p - b;
  const float d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + ab * (d1 / (d1 - d3));
  const Vec3f cp = p - c;
  const float d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + ac * (d2 / (d2 - d6));
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
  const float scale = 1 / (va + vb + vc);
  return a + ab * (vb * scale) + ac * (vc * scale);
}

float squared_distance(const Bounds3f& box, Vec3f p) {
  const Vec3f d{std::max({box.lo.x - p.x, 0.f, p.x - box.hi.x}),
                std::max({box.lo.y - p.y, 0.f, p.y - box.hi.y}),
                std::max({box.lo.z - p.z, 0.f, p.z - box.hi.z})};
  return dot(d, d);
}

double area(const Vec3f* corners) {
  const Vec3d a = static_cast<Vec3d>(corners[0]);
  return length(cross(static_cast<Vec3d>(corners[1]) - a, static_cast<Vec3d>(corners[2]) - a)) / 2;
}

void add_triangle(TriangleSoup& soup, Vec3f a, Vec3f b, Vec3f c) {
  soup.push_back(a);
  soup.push_back(b);
  soup.push_back(c);
}

void add_disc(TriangleSoup& soup, Vec3f center, Vec3f normal, float radius) {
  const Vec3f side = std::abs(normal.x) < 0.6f ? Vec3f{1, 0, 0} : Vec3f{0, 1, 0};
  const Vec3f u = normalized(cross(normal, side)), v = cross(normal, u);
  const auto corner = [&](int i) {
    const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / kDiscCorners;
    return center + (u * std::cos(angle) + v * std::sin(angle)) * radius;
  };
  for (int i = 0; i < kDiscCorners; ++i) add_triangle(soup, center, corner(i), corner(i + 1));
}

}  // namespace

TriangleSoup surface_of(const Scan& scan) {
  TriangleSoup soup;
  if (scan.is_cloud()) {
    RBVH_CHECK(scan.normals.size() == scan.positions.size() && scan.radii.size() == scan.positions.size());
    for (std::size_t i = 0; i < scan.positions.size(); ++i)
      if (is_finite(scan.positions[i]) && scan.radii[i] > 0 && dot(scan.normals[i], scan.normals[i]) > 0)
        add_disc(soup, scan.positions[i], scan.normals[i], scan.radii[i]);
    return soup;
  }
  for (const Triangle& t : scan.triangles) {
    const Vec3f a = scan.positions[t[0]], b = scan.positions[t[1]], c = scan.positions[t[2]];
    if (is_finite(a) && is_finite(b) && is_finite(c)) add_triangle(soup, a, b, c);
  }
  return soup;
}

void for_each_quad(const Level& level, const std::function<void(std::uint32_t leaf, std::uint32_t x,
                                                                std::uint32_t y, std::size_t texel)>& quad) {
  const std::vector<std::uint16_t>& heights = level.layers.at(0).texels;
  std::vector<bool> is_exact(level.leaves.size());
  for (const RbvhExactLeaf& exact : level.exact_leaves) is_exact[exact.leaf] = true;
  for (const RbvhNode& node : level.nodes) {
    if (node.count == 0 || is_exact[node.first]) continue;
    const RbvhLeaf& leaf = level.leaves[node.first];
    const TileFrame frame(leaf);
    const Bounds3f box{{node.lo[0], node.lo[1], node.lo[2]}, {node.hi[0], node.hi[1], node.hi[2]}};
    const double limit = static_cast<double>(kStepLimitTexels) * length(frame.u) / length(frame.w);
    for (std::uint32_t y = 0; y + 1 < leaf.height; ++y)
      for (std::uint32_t x = 0; x + 1 < leaf.width; ++x) {
        const std::size_t at = (std::size_t{leaf.y} + y) * level.atlas_width + leaf.x + x;
        const int h[4] = {heights[at], heights[at + 1], heights[at + level.atlas_width],
                          heights[at + level.atlas_width + 1]};
        if (std::find(h, h + 4, 0) != h + 4) continue;
        const auto step = [&](int i, int j) { return std::abs(h[i] - h[j]); };
        if (std::max({step(0, 1), step(2, 3), step(0, 2), step(1, 3)}) > limit) continue;
        const Vec3f a = frame.at(x, y, h[0]), d = frame.at(x + 1, y + 1, h[3]);
        if (squared_distance(box, (a + d) * 0.5f) > 0) continue;
        quad(node.first, x, y, at);
      }
  }
}

TriangleSoup surface_of(const Level& level) {
  TriangleSoup soup;
  for (const RbvhExactLeaf& exact : level.exact_leaves)
    for (std::uint32_t i = 0; i < level.leaves[exact.leaf].primitives; ++i) {
      const float* s = level.exact_primitives[exact.first + i].shape;
      if (level.exact_discs)
        add_disc(soup, {s[0], s[1], s[2]}, {s[4], s[5], s[6]}, s[3]);
      else
        add_triangle(soup, {s[0], s[1], s[2]}, {s[3], s[4], s[5]}, {s[6], s[7], s[8]});
    }
  const std::vector<std::uint16_t>& heights = level.layers.at(0).texels;
  for_each_quad(level, [&](std::uint32_t leaf, std::uint32_t x, std::uint32_t y, std::size_t at) {
    const TileFrame frame(level.leaves[leaf]);
    const auto corner = [&](std::uint32_t i, std::uint32_t j) {
      return frame.at(x + i, y + j, heights[at + j * level.atlas_width + i]);
    };
    add_triangle(soup, corner(0, 0), corner(1, 0), corner(1, 1));
    add_triangle(soup, corner(0, 0), corner(1, 1), corner(0, 1));
  });
  return soup;
}

// Median splits along the longest axis of the centres.
ClosestPoint::ClosestPoint(TriangleSoup triangles) {
  const std::size_t count = triangles.size() / 3;
  if (count == 0) return;
  std::vector<Vec3f> centers(count);
  for (std::size_t i = 0; i < count; ++i)
    centers[i] = (triangles[3 * i] + triangles[3 * i + 1] + triangles[3 * i + 2]) * (1.f / 3);
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  nodes_.push_back({{}, 0, static_cast<std::uint32_t>(count)});
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    const std::uint32_t first = nodes_[n].first, size = nodes_[n].count;
    Bounds3f middle;
    for (std::uint32_t i = first; i < first + size; ++i) {
      for (std::size_t k = 0; k < 3; ++k) nodes_[n].box.add(triangles[std::size_t{order[i]} * 3 + k]);
      middle.add(centers[order[i]]);
    }
    if (size <= kLeafTriangles) continue;
    const Vec3f extent = middle.extent();
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
    const std::uint32_t half = size / 2;
    const auto begin = order.begin() + static_cast<std::ptrdiff_t>(first);
    std::nth_element(begin, begin + static_cast<std::ptrdiff_t>(half),
                     begin + static_cast<std::ptrdiff_t>(size),
                     [&](std::uint32_t a, std::uint32_t b) { return centers[a][axis] < centers[b][axis]; });
    nodes_[n].first = static_cast<std::uint32_t>(nodes_.size());
    nodes_[n].count = 0;
    nodes_.push_back({{}, first, half});
    nodes_.push_back({{}, first + half, size - half});
  }
  triangles_.reserve(triangles.size());
  for (const std::uint32_t i : order)
    for (std::size_t k = 0; k < 3; ++k) triangles_.push_back(triangles[std::size_t{i} * 3 + k]);
  order_ = std::move(order);
}

ClosestPoint::Nearest ClosestPoint::find(Vec3f point) const {
  Nearest nearest;
  float best = nearest.distance;  // squared
  if (nodes_.empty()) return nearest;
  std::vector<std::pair<float, std::uint32_t>> stack = {{squared_distance(nodes_[0].box, point), 0}};
  while (!stack.empty()) {
    const auto [bound, n] = stack.back();
    stack.pop_back();
    if (bound >= best) continue;
    const Node& node = nodes_[n];
    if (node.count == 0) {
      const float left = squared_distance(nodes_[node.first].box, point),
                  right = squared_distance(nodes_[node.first + 1].box, point);
      const bool left_first = left <= right;
      stack.emplace_back(left_first ? right : left, node.first + (left_first ? 1 : 0));
      stack.emplace_back(left_first ? left : right, node.first + (left_first ? 0 : 1));
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Vec3f* t = &triangles_[std::size_t{i} * 3];
      const Vec3f q = closest_on_triangle(point, t[0], t[1], t[2]), d = point - q;
      if (!(dot(d, d) < best)) continue;
      best = dot(d, d);
      nearest.triangle = order_[i];
      nearest.point = q;
    }
  }
  nearest.distance = std::sqrt(best);
  return nearest;
}

DistanceStatistics sampled_distance(const TriangleSoup& from, const ClosestPoint& to, std::size_t samples) {
  const std::size_t count = from.size() / 3;
  std::vector<double> area_before(count + 1, 0);
  for (std::size_t i = 0; i < count; ++i) area_before[i + 1] = area_before[i] + area(&from[3 * i]);
  if (!(area_before.back() > 0) || samples == 0) return {};
  std::vector<float> distances(samples);
  parallel_for(samples, 1 << 10, [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      // Even steps through the area; within the triangle the R2 sequence (Roberts 2018), folded.
      const double at = area_before.back() * (static_cast<double>(s) + 0.5) / static_cast<double>(samples);
      const auto above = std::upper_bound(area_before.begin(), area_before.end(), at);
      const std::size_t i =
          std::min<std::size_t>(count, static_cast<std::size_t>(above - area_before.begin())) - 1;
      double u = std::fmod(0.7548776662466927 * static_cast<double>(s + 1), 1.0);
      double v = std::fmod(0.5698402909980532 * static_cast<double>(s + 1), 1.0);
      if (u + v > 1) {
        u = 1 - u;
        v = 1 - v;
      }
      const Vec3f* t = &from[3 * i];
      const Vec3f point =
          t[0] + (t[1] - t[0]) * static_cast<float>(u) + (t[2] - t[0]) * static_cast<float>(v);
      distances[s] = to.distance(point);
    }
  });
  DistanceStatistics statistics;
  double squares = 0;
  for (const float d : distances) {
    squares += static_cast<double>(d) * static_cast<double>(d);
    statistics.max = std::max(statistics.max, static_cast<double>(d));
  }
  statistics.rms = std::sqrt(squares / static_cast<double>(samples));
  return statistics;
}

}  // namespace rbvh
