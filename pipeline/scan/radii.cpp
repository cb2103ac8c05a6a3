// The discs around points in a plane cover it when each reaches the farthest corner of its point's Voronoi
// cell. So every point's cell is cut out of its tangent plane by its neighbours:
//
//      o     o          cell of x: the half-planes nearer to x than to each o;
//        .---.          its farthest corner is the radius
//    o   | x  \    o
//        '----'
//          o
#include "pipeline/scan/radii.h"

#include <array>
#include <numbers>

#include "pipeline/base/parallel_for.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 4096;
/// Corners further off than this many spacings are the edge of the scan or a real gap. Among points strewn at
/// random one corner in a million is.
constexpr double kGap = 2.5;
/// No disc is larger than this many times the median of its neighbours': a stray point shall not become a
/// plate.
constexpr float kLargest = 3;
/// Discs of a curved or noisy surface are tilted against each other, which opens slits between those that
/// just meet.
constexpr double kOverlap = 1.1;

struct Point2 {
  double u, v;
};

/// A convex polygon being cut by half-planes; one more corner for each cut at most.
class Cell {
 public:
  explicit Cell(double half) : corners_{{{-half, -half}, {half, -half}, {half, half}, {-half, half}}} {}

  /// Keeps what is nearer to the origin than to `other`.
  void cut(Point2 other) {
    const double limit = (other.u * other.u + other.v * other.v) / 2;
    const auto beyond = [&](Point2 c) { return c.u * other.u + c.v * other.v - limit; };
    std::size_t count = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const Point2 a = corners_[i], b = corners_[i + 1 < count_ ? i + 1 : 0];
      const double da = beyond(a), db = beyond(b);
      if (da <= 0) cut_[count++] = a;
      if ((da < 0 && db > 0) || (da > 0 && db < 0)) {
        const double t = da / (da - db);
        cut_[count++] = {a.u + t * (b.u - a.u), a.v + t * (b.v - a.v)};
      }
      if (count + 2 > kMost) break;  // never near it: cells of more than a dozen corners do not occur
    }
    std::swap(corners_, cut_);
    count_ = count;
  }
  /// The distances squared of the farthest corner, and of the farthest that is not beyond `limit`.
  double farthest(double limit) const {
    double result = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const double squared = corners_[i].u * corners_[i].u + corners_[i].v * corners_[i].v;
      if (squared <= limit && squared > result) result = squared;
    }
    return result;
  }

 private:
  static constexpr std::size_t kMost = 64;
  std::array<Point2, kMost> corners_, cut_;
  std::size_t count_ = 4;
};

double cover_radius(std::span<const Vec3f> points, std::size_t self, Vec3d normal,
                    std::span<const std::uint32_t> others, std::vector<Point2>& around) {
  const Vec3d axis = std::abs(normal.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  const Vec3d tangent = normalized(cross(normal, axis)), bitangent = cross(normal, tangent);
  const Vec3d origin = static_cast<Vec3d>(points[self]);
  around.clear();
  double farthest = 0;
  for (const std::uint32_t other : others) {
    const Vec3d d = static_cast<Vec3d>(points[other]) - origin;
    const Point2 p{dot(d, tangent), dot(d, bitangent)};
    const double squared = p.u * p.u + p.v * p.v, off = dot(d, normal);
    // Steeper than 45 degrees off the plane: another sheet, or noise; it covers nothing here.
    if (squared == 0 || off * off > squared) continue;
    around.push_back(p);
    farthest = std::max(farthest, squared);
  }
  if (around.empty()) {
    // Only points above or below: half the way to the nearest that is not equal.
    for (const std::uint32_t other : others) {
      const double distance = length(static_cast<Vec3d>(points[other]) - origin);
      if (distance > 0) return distance / 2;
    }
    return 0;
  }
  // So many points in a circle around this one: their spacing.
  const double spacing = std::sqrt(std::numbers::pi * farthest / static_cast<double>(around.size() + 1));
  const double gap = kGap * spacing;
  Cell cell(2 * gap);
  for (const Point2& p : around) cell.cut(p);
  const double squared = cell.farthest(gap * gap);
  // No corner at all: a point at the end of a line of points.
  return squared > 0 ? std::sqrt(squared) : spacing / 2;
}

}  // namespace

std::vector<float> estimate_radii(std::span<const Vec3f> points, std::span<const Vec3f> normals,
                                  const Neighbors& neighbors) {
  std::vector<float> cover(points.size());
  parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<Point2> around;
    for (std::size_t i = begin; i < end; ++i)
      cover[i] = static_cast<float>(
          cover_radius(points, i, normalized(static_cast<Vec3d>(normals[i])), neighbors.of(i), around));
  });
  std::vector<float> radii(points.size());
  parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<float> nearby;
    for (std::size_t i = begin; i < end; ++i) {
      nearby.clear();
      for (const std::uint32_t other : neighbors.of(i)) nearby.push_back(cover[other]);
      if (nearby.empty()) continue;
      const auto middle = nearby.begin() + static_cast<std::ptrdiff_t>(nearby.size() / 2);
      std::nth_element(nearby.begin(), middle, nearby.end());
      const float most = *middle > 0 ? kLargest * *middle : cover[i];
      radii[i] = static_cast<float>(kOverlap) * std::min(cover[i], most);
    }
  });
  return radii;
}

double surface_area(const Scan& scan) {
  double area = 0;
  for (const Triangle& t : scan.triangles) {
    const Vec3d a = static_cast<Vec3d>(scan.positions[t[0]]), b = static_cast<Vec3d>(scan.positions[t[1]]),
                c = static_cast<Vec3d>(scan.positions[t[2]]);
    const double twice = length(cross(b - a, c - a));
    if (std::isfinite(twice)) area += twice / 2;
  }
  if (scan.is_cloud())
    for (std::size_t i = 0; i < scan.radii.size(); ++i)
      if (is_finite(scan.positions[i]) && std::isfinite(scan.radii[i])) area += disc_area(scan.radii[i]);
  return area;
}

}  // namespace rbvh
