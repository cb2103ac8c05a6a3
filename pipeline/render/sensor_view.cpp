#include "pipeline/render/sensor_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "pipeline/base/vector_math.h"
#include "rbvh/frame.h"
#include "rbvh/scan.h"

namespace rbvh {
namespace {

constexpr double kFarthest = 4;   // diagonals from the middle to the origin, or that is no sensor's place
constexpr double kFacing = 0.9;   // least part of the surface that faces the sensor
constexpr double kVisible = 0.8;  // and that nothing stands before
constexpr std::size_t kMostRays = 8192;
constexpr double kWidest = 55;       // degrees off the view that a picture may reach
constexpr double kOutside = 0.0005;  // of the points, on each side, may be outside the picture
constexpr double kMargin = 1.04;

struct SurfacePoint {
  Vec3d position;
  Vec3d normal;
};

std::vector<SurfacePoint> surface_points(std::span<const SmallPicture> pictures) {
  std::vector<SurfacePoint> points;
  for (const SmallPicture& picture : pictures)
    for (std::size_t i = 0; i < picture.hits.size(); ++i) {
      const Hit& hit = picture.hits[i];
      if (!std::isfinite(hit.t)) continue;
      const Ray ray = pixel_ray(picture.rays, static_cast<std::uint32_t>(i % picture.rays.width),
                                static_cast<std::uint32_t>(i / picture.rays.width));
      points.push_back({static_cast<Vec3d>(array3(ray.origin) + array3(ray.direction) * hit.t),
                        static_cast<Vec3d>(array3(hit.normal))});
    }
  return points;
}

/// Whether all of the surface can have been seen from there.
bool sees_all(const Tracer& tracer, std::span<const SurfacePoint> points, Vec3d sensor) {
  const std::size_t step = points.size() / kMostRays + 1;
  std::vector<Ray> rays;
  std::size_t asked = 0;
  for (std::size_t i = 0; i < points.size(); i += step) {
    ++asked;
    const Vec3d way = points[i].position - sensor;
    if (!(dot(points[i].normal, way) < 0)) continue;
    const Vec3f from = static_cast<Vec3f>(sensor), to = static_cast<Vec3f>(way);
    rays.push_back({{from.x, from.y, from.z}, 0, {to.x, to.y, to.z}, 0.97f});
  }
  if (static_cast<double>(rays.size()) < kFacing * static_cast<double>(asked)) return false;
  const std::vector<std::uint8_t> blocked = occluded(tracer, rays);
  const auto free = std::count(blocked.begin(), blocked.end(), std::uint8_t{0});
  return static_cast<double>(free) >= kVisible * static_cast<double>(rays.size());
}

/// What is up for a sensor of which only the direction of its view is known: cameras' axes are x right, y
/// down, z forward, or x right, y up, z back; those of vehicles and maps have z up.
Vec3d usual_up(Vec3d forward) {
  if (std::abs(forward.z) < 0.7) return {0, 0, 1};
  return forward.z > 0 ? Vec3d{0, -1, 0} : Vec3d{0, 1, 0};
}

double quantile(std::vector<double> values, double part) {
  const auto nth =
      values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

/// What of a picture's plane at distance 1 nearly all values lie in.
struct Extent {
  double middle, half;
};
Extent extent(const std::vector<double>& values) {
  const double lo = quantile(values, kOutside), hi = quantile(values, 1 - kOutside);
  return {(lo + hi) / 2, (hi - lo) / 2};
}

/// The camera at `sensor`. None where the points lie too far around it.
std::optional<CameraWords> camera_at(Vec3d sensor, std::span<const SurfacePoint> points,
                                     std::optional<Vec3d> given_up, double aspect) {
  Vec3d forward{};
  std::vector<double> distances;
  for (const SurfacePoint& point : points) {
    forward = forward + normalized(point.position - sensor);
    distances.push_back(length(point.position - sensor));
  }
  forward = normalized(forward);
  if (!(length(forward) > 0)) return std::nullopt;
  const Vec3d up = normalized(given_up.value_or(usual_up(forward)));
  Vec3d above;
  Extent wide{}, high{};
  for (int i = 0; i < 3; ++i) {  // each time turned to the middle
    if (std::abs(dot(forward, up)) > 0.98) return std::nullopt;
    const Vec3d right = normalized(cross(forward, up));
    above = cross(right, forward);
    std::vector<double> x, y;
    for (const SurfacePoint& point : points) {
      const Vec3d way = point.position - sensor;
      const double depth = dot(way, forward);
      if (!(depth > 0)) continue;
      x.push_back(dot(way, right) / depth);
      y.push_back(dot(way, above) / depth);
    }
    if (static_cast<double>(x.size()) < (1 - kOutside) * static_cast<double>(points.size()))
      return std::nullopt;
    wide = extent(x);
    high = extent(y);
    const double widest = std::tan(kWidest * std::numbers::pi / 180);
    if (!(wide.half < widest && high.half < widest)) return std::nullopt;
    forward = normalized(forward + right * wide.middle + above * high.middle);
  }
  CameraWords words;
  words.position = sensor;
  words.focal_point = sensor + forward * quantile(distances, 0.5);
  words.view_up = above;
  const double slope = kMargin * std::max(high.half, wide.half / aspect);
  words.view_angle = std::clamp(2 * std::atan(slope) * 180 / std::numbers::pi, 1., 160.);
  return words;
}

}  // namespace

std::optional<ChosenView> sensor_view(const Tracer& tracer, const Asset& asset,
                                      std::span<const SmallPicture> pictures, std::optional<Vec3d> up,
                                      double aspect) {
  if (!asset.is_cloud) return std::nullopt;
  const Scan* scan = asset.scan();
  if (scan != nullptr && scan->viewpoints.size() > 1) return std::nullopt;
  const std::vector<SurfacePoint> points = surface_points(pictures);
  if (points.empty()) return std::nullopt;
  Viewpoint viewpoint{.position = -shift(asset), .is_default = true};
  if (scan != nullptr && scan->viewpoints.size() == 1) viewpoint = scan->viewpoints.front();
  if (viewpoint.is_default) {
    const double far = length(viewpoint.position - static_cast<Vec3d>(asset.bounds.center()));
    if (far > kFarthest * static_cast<double>(asset.bounds.diagonal())) return std::nullopt;
    if (!sees_all(tracer, points, viewpoint.position)) return std::nullopt;
  }
  const auto words = camera_at(viewpoint.position, points, up, aspect);
  if (!words) return std::nullopt;
  ChosenView view;
  view.words = *words;
  view.up = *words->view_up;
  view.text = viewpoint.is_default ? "the sensor's view, from the origin, which sees all of the surface"
                                   : "the sensor's view";
  return view;
}

}  // namespace rbvh
