#include "pipeline/scan/closest_point.h"

#include <cmath>
#include <numbers>
#include <numeric>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kLeafTriangles = 4;
constexpr int kDiscCorners = 8;

}  // namespace

// Ericson, Real-Time Collision Detection, 5.1.5. In doubles: products of dot products cancel in slivers.
std::array<float, 3> nearest_weights(Vec3f p, Vec3f a, Vec3f b, Vec3f c) {
  const auto from_p = [p](Vec3f at) { return static_cast<Vec3d>(at) - static_cast<Vec3d>(p); };
  const Vec3d pa = from_p(a), pb = from_p(b), pc = from_p(c), ab = pb - pa, ac = pc - pa;
  const double d1 = -dot(ab, pa), d2 = -dot(ac, pa), d3 = -dot(ab, pb), d4 = -dot(ac, pb), d5 = -dot(ab, pc),
               d6 = -dot(ac, pc);
  const auto on_edge = [](double from, double to) {
    return from + to > 0 ? static_cast<float>(from / (from + to)) : 0.0f;
  };
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const float w = on_edge(d1, -d3);
    return {1 - w, w, 0};
  }
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const float w = on_edge(d2, -d6);
    return {1 - w, 0, w};
  }
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const float w = on_edge(d4 - d3, d5 - d6);
    return {0, 1 - w, w};
  }
  const double sum = va + vb + vc;
  if (!(sum > 0)) return {1, 0, 0};
  return {static_cast<float>(va / sum), static_cast<float>(vb / sum), static_cast<float>(vc / sum)};
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
      const std::array<float, 3> w = nearest_weights(point, t[0], t[1], t[2]);
      const Vec3f q = t[0] * w[0] + t[1] * w[1] + t[2] * w[2], d = point - q;
      if (!(dot(d, d) < best)) continue;
      best = dot(d, d);
      nearest.triangle = order_[i];
      nearest.point = q;
    }
  }
  nearest.distance = std::sqrt(best);
  return nearest;
}

}  // namespace rbvh
