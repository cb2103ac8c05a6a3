#include "pipeline/proxy/self_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

// A triangle of the fan may not be flatter than this, twice its area over the square of the star's mean
// radius: points in it would fall anywhere.
constexpr double kLeastFanArea = 1e-3;
constexpr double kWidestGap = 0.9 * std::numbers::pi;

struct Flat {
  double x, y;
};
double cross(Flat a, Flat b) { return a.x * b.y - a.y * b.x; }
Flat operator-(Flat a, Flat b) { return {a.x - b.x, a.y - b.y}; }

double angle_between(Vec3d a, Vec3d b) { return std::atan2(length(rbvh::cross(a, b)), dot(a, b)); }

// The ring's directions from the center, with gaps scaled to sum up to 360 degrees (180 on a boundary).
std::vector<double> ring_angles(const std::vector<Vec3d>& spokes, bool is_boundary, double& total) {
  const std::size_t gaps = spokes.size() - (is_boundary ? 1 : 0);
  const double full = (is_boundary ? 1 : 2) * std::numbers::pi;
  std::vector<double> gap(gaps);
  total = 0;
  for (std::size_t i = 0; i < gaps; ++i) {
    gap[i] = angle_between(spokes[i], spokes[(i + 1) % spokes.size()]);
    total += gap[i];
  }
  bool is_usable = total > 1e-6;
  for (const double g : gap) is_usable &= g * full < kWidestGap * total && g * full > 1e-3 * total;
  std::vector<double> angles(spokes.size(), 0.0);
  for (std::size_t i = 0; i + 1 < spokes.size(); ++i)
    angles[i + 1] = angles[i] + (is_usable ? gap[i] * full / total : full / static_cast<double>(gaps));
  if (!is_usable) total = 0;
  return angles;
}

bool is_fan(const std::vector<Flat>& ring, std::size_t from, double least_area) {
  for (std::size_t i = 0; i + 1 < ring.size(); ++i)
    if (i != from && i + 1 != from && !(cross(ring[i] - ring[from], ring[i + 1] - ring[from]) > least_area))
      return false;
  return true;
}

// z^a (the conformal map of a cone to the plane), or, where the fan would fold, all neighbours on a circle,
// which is convex: no fan folds there.
std::vector<Flat> flatten(Vec3d center, std::span<const Vec3d> ring, bool is_boundary, std::size_t fan_from,
                          double least_area, bool& is_circle) {
  std::vector<Vec3d> spokes(ring.size());
  double mean = 0;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    spokes[i] = ring[i] - center;
    mean += length(spokes[i]);
  }
  mean /= static_cast<double>(ring.size());
  double total = 0;
  const std::vector<double> angles = ring_angles(spokes, is_boundary, total);
  std::vector<Flat> flat(ring.size());
  const auto lay = [&](double power) {
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const double radius = power > 0 ? std::pow(std::max(length(spokes[i]) / mean, 1e-3), power) : 1;
      flat[i] = {radius * std::cos(angles[i]), radius * std::sin(angles[i])};
    }
    if (is_boundary) flat.front().y = flat.back().y = 0;  // the center lies between the two
  };
  if (total > 0) {
    const double full = (is_boundary ? 1 : 2) * std::numbers::pi;
    lay(std::clamp(full / total, 0.5, 2.0));
    is_circle = !is_fan(flat, fan_from, least_area);
  } else {
    is_circle = true;
  }
  if (is_circle) lay(0);
  return flat;
}

}  // namespace

std::uint32_t SelfMap::remove_vertex(Vec3d center, std::span<const Vec3d> ring,
                                     std::span<const StarFace> star, std::uint32_t fan_from) {
  RBVH_CHECK(ring.size() >= 3 && ring.size() <= UINT16_MAX);
  const bool is_boundary = star.size() + 1 == ring.size();
  RBVH_CHECK(is_boundary || star.size() == ring.size());
  RBVH_CHECK(fan_from == 0 || (is_boundary && fan_from + 1 == ring.size()));
  bool is_circle = false;
  const std::vector<Flat> flat = flatten(center, ring, is_boundary, fan_from, kLeastFanArea, is_circle);
  circle_steps_ += is_circle;

  const std::uint32_t first = version_count();
  RBVH_CHECK(UINT32_MAX - first > ring.size());
  const auto step = static_cast<std::uint32_t>(steps_.size());
  steps_.push_back({ring_.size(), star_.size(), first, static_cast<std::uint16_t>(ring.size()), is_boundary,
                    fan_from != 0});
  for (const Flat& p : flat) ring_.push_back({static_cast<float>(p.x), static_cast<float>(p.y)});
  for (const StarFace& face : star) {
    star_.push_back(face.version);
    corner_.push_back(static_cast<std::uint8_t>(face.corner_of_center));
  }
  step_of_.insert(step_of_.end(), ring.size() - 2, step);
  return first;
}

bool SelfMap::lies_flat(Vec3d center, std::span<const Vec3d> ring, bool is_boundary, std::uint32_t fan_from,
                        double least_area) {
  bool is_circle = false;
  flatten(center, ring, is_boundary, fan_from, least_area, is_circle);
  return !is_circle;
}

FacePoint SelfMap::to_original(FacePoint point) const {
  while (point.version >= originals_) {
    const Step& step = steps_[step_of_[point.version - originals_]];
    const Point2* ring = ring_.data() + step.first_ring;
    const std::uint32_t n = step.ring_size;
    // Into the plane ...
    const std::uint32_t from = step.fans_from_last ? n - 1 : 0;
    const std::uint32_t i = point.version - step.first_version + (step.fans_from_last ? 0 : 1);
    const auto& w = point.weights;
    const double x = w[0] * ring[from].x + w[1] * ring[i].x + w[2] * ring[i + 1].x;
    const double y = w[0] * ring[from].y + w[1] * ring[i].y + w[2] * ring[i + 1].y;
    // ... and into the triangle of the star whose two coordinates along its spokes are least negative.
    const std::uint32_t faces = n - (step.is_boundary ? 1 : 0);
    double best = -1e300, best_1 = 0, best_2 = 0;
    std::uint32_t best_face = 0;
    for (std::uint32_t k = 0; k < faces; ++k) {
      const Point2 a = ring[k], b = ring[k + 1 == n ? 0 : k + 1];
      const double ax = a.x, ay = a.y, bx = b.x, by = b.y;
      const double area = ax * by - ay * bx;
      const double w1 = (x * by - y * bx) / area, w2 = (ax * y - ay * x) / area;
      const double least = std::min(w1, w2);
      if (least > best) {
        best = least;
        best_1 = w1;
        best_2 = w2;
        best_face = k;
        if (least >= 0) break;
      }
    }
    // Rounding may leave a point a little outside.
    best_1 = std::max(best_1, 0.0);
    best_2 = std::max(best_2, 0.0);
    const double sum = best_1 + best_2;
    if (sum > 1) {
      best_1 /= sum;
      best_2 /= sum;
    }
    const std::uint32_t corner = corner_[step.first_star + best_face];
    point.version = star_[step.first_star + best_face];
    point.weights[corner] = std::max(0.0, 1 - best_1 - best_2);
    point.weights[(corner + 1) % 3] = best_1;
    point.weights[(corner + 2) % 3] = best_2;
  }
  return point;
}

std::uint64_t SelfMap::bytes() const {
  return steps_.capacity() * sizeof(Step) + ring_.capacity() * sizeof(Point2) +
         star_.capacity() * sizeof(std::uint32_t) + corner_.capacity() +
         step_of_.capacity() * sizeof(std::uint32_t);
}

}  // namespace rbvh
