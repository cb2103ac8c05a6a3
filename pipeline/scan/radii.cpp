// The discs around points in a plane cover it when each extends to the farthest corner of its point's Voronoi
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
#include "pipeline/scan/normals.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 4096;
/// Corners further off than this many spacings are the edge of the scan or a real gap. Among points strewn at
/// random one corner in a million is.
constexpr double kGap = 2.5;
/// No disc is larger than this many times the median of its neighbours': a stray point must not become a
/// plate.
constexpr float kLargest = 3;
/// Discs of a curved or noisy surface are tilted against each other, which opens slits between those that
/// just touch.
constexpr double kOverlap = 1.1;
/// Discs at which a cloud's area is measured, and neighbours of each.
constexpr std::size_t kSamples = 20000, kSampleNeighbors = 24;

struct Point2 {
  double u, v;
};

/// A convex polygon being cut by half-planes; one more corner for each cut at most.
class Cell {
 public:
  /// Begins as a regular polygon around a circle of the given radius, of the same area.
  explicit Cell(double radius) {
    const double angle = 2 * std::numbers::pi / kSides;
    const double circumradius = radius * std::sqrt(angle / std::sin(angle));
    for (std::size_t i = 0; i < kSides; ++i)
      corners_[i] = {circumradius * std::cos(angle * static_cast<double>(i)),
                     circumradius * std::sin(angle * static_cast<double>(i))};
  }

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
  /// The distance squared of the farthest corner that is not beyond `limit` (squared); 0 for none.
  double farthest(double limit) const {
    double result = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const double squared = corners_[i].u * corners_[i].u + corners_[i].v * corners_[i].v;
      if (squared <= limit && squared > result) result = squared;
    }
    return result;
  }
  double area() const {
    double twice = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const Point2 a = corners_[i], b = corners_[i + 1 < count_ ? i + 1 : 0];
      twice += a.u * b.v - a.v * b.u;
    }
    return twice / 2;
  }

 private:
  static constexpr std::size_t kSides = 16, kMost = 64;
  std::array<Point2, kMost> corners_, cut_;
  std::size_t count_ = kSides;
};

/// The neighbours in the tangent plane, without those steeper than 45 degrees off it: another sheet, or
/// noise, which covers nothing here. Nearest first but for that.
void project(std::span<const Vec3f> points, std::size_t self, Vec3d normal,
             std::span<const std::uint32_t> others, std::vector<Point2>& around) {
  const Vec3d axis = std::abs(normal.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  const Vec3d tangent = normalized(cross(normal, axis)), bitangent = cross(normal, tangent);
  const Vec3d origin = static_cast<Vec3d>(points[self]);
  around.clear();
  for (const std::uint32_t other : others) {
    const Vec3d d = static_cast<Vec3d>(points[other]) - origin;
    const Point2 p{dot(d, tangent), dot(d, bitangent)};
    const double squared = p.u * p.u + p.v * p.v, off = dot(d, normal);
    if (squared > 0 && off * off <= squared) around.push_back(p);
  }
}

double cover_radius(std::span<const Vec3f> points, std::size_t self, Vec3d normal,
                    std::span<const std::uint32_t> others, std::vector<Point2>& around) {
  project(points, self, normal, others, around);
  if (around.empty()) {
    // Only points above or below: half the way to the nearest that is not equal.
    for (const std::uint32_t other : others) {
      const double distance = length(static_cast<Vec3d>(points[other]) - static_cast<Vec3d>(points[self]));
      if (distance > 0) return distance / 2;
    }
    return 0;
  }
  // So many points in a circle around this one: their spacing.
  double farthest = 0;
  for (const Point2& p : around) farthest = std::max(farthest, p.u * p.u + p.v * p.v);
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

namespace {

double triangle_area(const Scan& scan) {
  double area = 0;
  for (const Triangle& t : scan.triangles) {
    const Vec3d a = static_cast<Vec3d>(scan.positions[t[0]]), b = static_cast<Vec3d>(scan.positions[t[1]]),
                c = static_cast<Vec3d>(scan.positions[t[2]]);
    const double twice = length(cross(b - a, c - a));
    if (std::isfinite(twice)) area += twice / 2;
  }
  return area;
}

struct Discs {
  std::vector<Vec3f> points, normals;
  std::vector<float> radii;
  double squares = 0;  ///< the sum of the squared radii
};

Discs usable_discs(const Scan& scan) {
  Discs discs;
  if (scan.radii.empty() || scan.normals.empty()) return discs;
  for (std::size_t i = 0; i < scan.positions.size(); ++i) {
    const float radius = scan.radii[i];
    if (!is_finite(scan.positions[i]) || !is_direction(scan.normals[i]) || !std::isfinite(radius) ||
        !(radius > 0))
      continue;
    discs.points.push_back(scan.positions[i]);
    discs.normals.push_back(scan.normals[i]);
    discs.radii.push_back(radius);
    discs.squares += static_cast<double>(radius) * static_cast<double>(radius);
  }
  return discs;
}

/// The part of the discs' squared radii that their cells take. What faces the other way is another side's.
double cells_per_square(const Discs& discs) {
  const std::size_t step = (discs.points.size() + kSamples - 1) / kSamples;
  const Neighbors neighbors = find_neighbors(discs.points, kSampleNeighbors, {}, step);
  double cells = 0, squares = 0;
  std::vector<std::uint32_t> same_side;
  std::vector<Point2> around;
  for (std::size_t i = 0; i < discs.points.size(); i += step) {
    same_side.clear();
    for (const std::uint32_t other : neighbors.of(i))
      if (dot(discs.normals[i], discs.normals[other]) > 0) same_side.push_back(other);
    project(discs.points, i, normalized(static_cast<Vec3d>(discs.normals[i])), same_side, around);
    const double radius = static_cast<double>(discs.radii[i]);
    Cell cell(radius);
    for (const Point2& p : around) cell.cut(p);
    cells += cell.area();
    squares += radius * radius;
  }
  return cells / squares;
}

}  // namespace

double surface_area(const Scan& scan) {
  if (!scan.is_cloud()) return triangle_area(scan);
  const Discs discs = usable_discs(scan);
  return discs.points.empty() ? 0 : discs.squares * cells_per_square(discs);
}

double spacing_per_radius(const Scan& scan) {
  const Discs discs = usable_discs(scan);
  return !scan.is_cloud() || discs.points.empty() ? 1 : std::sqrt(cells_per_square(discs));
}

}  // namespace rbvh
