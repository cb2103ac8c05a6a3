#include "pipeline/scan/cut_polygons.h"

#include <array>
#include <cmath>

namespace rbvh {
namespace {

/// Ears are found in quadratic time: more corners stay a fan.
constexpr std::size_t kMostCorners = 20000;
/// Edges that cross are looked for in polygons up to this.
constexpr std::size_t kMostToCross = 2000;

struct Point {
  double x, y;
};
using Ear = std::array<std::size_t, 3>;

/// Twice the signed area.
double area(Point a, Point b, Point c) { return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x); }
bool same(Point a, Point b) { return a.x == b.x && a.y == b.y; }

/// Inside or on an edge, but no corner.
bool inside(Point p, Point a, Point b, Point c) {
  return area(a, b, p) >= 0 && area(b, c, p) >= 0 && area(c, a, p) >= 0 && !same(p, a) && !same(p, b) &&
         !same(p, c);
}

/// The corners along the axis that Newell's normal is nearest to, counter-clockwise; empty where the polygon
/// has no area or a corner that is not finite.
std::vector<Point> project(std::span<const std::uint32_t> corners, std::span<const Vec3d> positions) {
  Vec3d normal;
  const Vec3d origin = positions[corners[0]];
  for (std::size_t i = 0; i < corners.size(); ++i)
    normal =
        normal + cross(positions[corners[i]] - origin, positions[corners[(i + 1) % corners.size()]] - origin);
  if (!is_finite(normal) || normal == Vec3d{}) return {};
  int axis = 0;
  for (int i = 1; i < 3; ++i)
    if (std::abs(normal[i]) > std::abs(normal[axis])) axis = i;
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  std::vector<Point> points;
  for (const std::uint32_t corner : corners) {
    const Vec3d p = positions[corner] - origin;
    points.push_back(normal[axis] > 0 ? Point{p[u], p[v]} : Point{p[v], p[u]});
  }
  return points;
}

bool is_filled_by_fan(const std::vector<Point>& points) {
  for (std::size_t i = 2; i < points.size(); ++i)
    if (!(area(points[0], points[i - 1], points[i]) > 0)) return false;
  return true;
}

bool has_crossing_edges(const std::vector<Point>& points) {
  const std::size_t n = points.size();
  if (n > kMostToCross) return false;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i + 2; j < n; ++j) {
      const Point a = points[i], b = points[i + 1], c = points[j], d = points[(j + 1) % n];
      if (area(a, b, c) * area(a, b, d) < 0 && area(c, d, a) * area(c, d, b) < 0) return true;
    }
  return false;
}

/// Cuts off ear after ear. Where no corner is one, one without an angle goes, else any: the edges cross.
class EarCutter {
 public:
  explicit EarCutter(const std::vector<Point>& points) : points_(points) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      next_.push_back((i + 1) % points.size());
      previous_.push_back((i + points.size() - 1) % points.size());
    }
  }

  /// Triangles as indices of points; false where the edges cross.
  bool cut(std::vector<Ear>& triangles) {
    bool sound = true;
    std::size_t left = points_.size(), at = 0, tried = 0;
    while (left > 3) {
      const bool stuck = tried >= left, lost = tried >= 2 * left;
      sound &= !lost;
      if (lost || is_ear(at) || (stuck && turn(at) == 0)) {
        triangles.push_back({previous_[at], at, next_[at]});
        next_[previous_[at]] = next_[at];
        previous_[next_[at]] = previous_[at];
        --left;
        tried = 0;
      } else {
        ++tried;
      }
      // Not the neighbour at once, which would make a fan of slivers.
      at = tried == 0 ? next_[next_[at]] : next_[at];
    }
    triangles.push_back({previous_[at], at, next_[at]});
    return sound;
  }

 private:
  double turn(std::size_t i) const { return area(points_[previous_[i]], points_[i], points_[next_[i]]); }

  bool is_ear(std::size_t i) const {
    if (!(turn(i) > 0)) return false;
    const Point a = points_[previous_[i]], b = points_[i], c = points_[next_[i]];
    for (std::size_t j = next_[next_[i]]; j != previous_[i]; j = next_[j])
      if (inside(points_[j], a, b, c)) return false;
    return true;
  }

  const std::vector<Point>& points_;
  std::vector<std::size_t> next_, previous_;
};

enum class Cut { kGood, kCrossing, kTooMany };

/// `ears`: the triangles that the fan becomes, as numbers of corners; none: it stays.
Cut cut_polygon(std::span<const std::uint32_t> corners, std::span<const Vec3d> positions,
                std::span<const Triangle> triangles, std::vector<Ear>& ears) {
  ears.clear();
  const std::vector<Point> points = project(corners, positions);
  if (points.empty()) {
    // No area in all, but in parts: they cancel out.
    for (const Triangle& t : triangles) {
      const Vec3d n = cross(positions[t[1]] - positions[t[0]], positions[t[2]] - positions[t[0]]);
      if (is_finite(n) && n != Vec3d{}) return Cut::kCrossing;
    }
    return Cut::kGood;
  }
  if (is_filled_by_fan(points)) return Cut::kGood;
  if (corners.size() > kMostCorners) return Cut::kTooMany;
  const bool sound = EarCutter(points).cut(ears) && !has_crossing_edges(points);
  return sound ? Cut::kGood : Cut::kCrossing;
}

}  // namespace

void add_notes(const PolygonFaults& faults, std::vector<std::string>& notes) {
  if (faults.crossing > 0)
    notes.push_back(std::to_string(faults.crossing) +
                    " polygons have edges that cross: what they enclose was guessed");
  if (faults.too_many > 0)
    notes.push_back(std::to_string(faults.too_many) + " concave polygons of more than " +
                    std::to_string(kMostCorners) + " corners were cut as fans");
}

PolygonFaults Fans::cut_again(std::span<const Vec3d> positions, std::vector<Triangle>& triangles,
                              std::span<FaceTexture> textures) const {
  PolygonFaults faults;
  std::vector<std::uint32_t> corners;
  std::vector<std::array<float, 2>> places;
  std::vector<Ear> ears;
  for (const Fan& fan : fans_) {
    corners.assign({triangles[fan.first][0], triangles[fan.first][1]});
    for (std::size_t t = 0; t < fan.count; ++t) corners.push_back(triangles[fan.first + t][2]);
    const Cut cut = cut_polygon(corners, positions, std::span(triangles).subspan(fan.first, fan.count), ears);
    for (std::size_t t = 0; t < ears.size(); ++t)
      for (std::size_t c = 0; c < 3; ++c) triangles[fan.first + t][c] = corners[ears[t][c]];
    if (!ears.empty() && !textures.empty()) {
      const auto own = textures.subspan(fan.first, fan.count);
      places.assign({own[0].corners[0], own[0].corners[1]});
      for (const FaceTexture& face : own) places.push_back(face.corners[2]);
      for (std::size_t t = 0; t < ears.size(); ++t)
        for (std::size_t c = 0; c < 3; ++c) own[t].corners[c] = places[ears[t][c]];
    }
    faults.crossing += cut == Cut::kCrossing;
    faults.too_many += cut == Cut::kTooMany;
  }
  return faults;
}

}  // namespace rbvh
