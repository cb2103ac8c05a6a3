#include "rbvh/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kMargin = 1.04;    // the frame is this much wider than the object
constexpr double kFarthest = 1e30;  // scan units; rays are floats
constexpr double kDefaultViewAngle = 30, kDefaultAzimuth = 30, kDefaultElevation = 20;

[[noreturn]] void refuse(const std::string& what) { throw Error(ErrorKind::kUsage, "", what); }

// Rodrigues' rotation by `degrees` about the unit vector `axis`.
Vec3d rotate(Vec3d v, Vec3d axis, double degrees) {
  const double c = std::cos(degrees * kDegree), s = std::sin(degrees * kDegree);
  return v * c + cross(axis, v) * s + axis * (dot(axis, v) * (1 - c));
}

struct Frame {
  Vec3d back, right, up;  // back: from the focal point to the camera
};

Frame frame_of(Vec3d back, Vec3d view_up) {
  const double far = length(back);
  const Vec3d right = cross(view_up, back);
  if (!(far > 0)) refuse("the camera's position is its focal point; move one of them");
  if (!(length(right) > 1e-9 * far * length(view_up)))
    throw Error(ErrorKind::kUsage, "", "the camera looks along its view up", Remedy::kViewUp);
  Frame frame{normalized(back), normalized(right), {}};
  frame.up = cross(frame.back, frame.right);
  return frame;
}

void turn(Frame& frame, Vec3d axis, double degrees) {
  frame.back = rotate(frame.back, axis, degrees);
  frame.right = rotate(frame.right, axis, degrees);
  frame.up = rotate(frame.up, axis, degrees);
}

using Corners = std::array<Vec3d, 8>;

// How far from the focal point (the origin) a camera must be for all corners to lie between the image's edges
// along `axis`; `slope` is the tangent of half the view angle that way. With `movable` the camera may slide
// along the axis.
double fit_distance(const Corners& corners, Vec3d axis, Vec3d back, double slope, bool movable) {
  double plus = -std::numeric_limits<double>::infinity(), minus = plus;
  for (const Vec3d& corner : corners) {
    const double x = dot(corner, axis), z = dot(corner, back);
    plus = std::max(plus, x / slope + z);
    minus = std::max(minus, -x / slope + z);
  }
  return movable ? (plus + minus) / 2 : std::max(plus, minus);
}

// How far to slide along `axis`, at `distance`, for equal room on both sides of the picture.
double fit_middle(const Corners& corners, Vec3d axis, Vec3d back, double distance) {
  const auto imbalance = [&](double middle) {  // falls as the middle grows
    double lo = std::numeric_limits<double>::infinity(), hi = -lo;
    for (const Vec3d& corner : corners) {
      const double slope = (dot(corner, axis) - middle) / (distance - dot(corner, back));
      lo = std::min(lo, slope);
      hi = std::max(hi, slope);
    }
    return lo + hi;
  };
  double lo = std::numeric_limits<double>::infinity(), hi = -lo;
  for (const Vec3d& corner : corners) {
    lo = std::min(lo, dot(corner, axis));
    hi = std::max(hi, dot(corner, axis));
  }
  for (int i = 0; i < 60; ++i) (imbalance((lo + hi) / 2) > 0 ? lo : hi) = (lo + hi) / 2;
  return (lo + hi) / 2;
}

}  // namespace

Vec3d front_of(Vec3d up_axis) {
  const Vec3d right = std::abs(up_axis.x) > 0.5 ? Vec3d{0, 1, 0} : Vec3d{1, 0, 0};
  return normalized(cross(right, up_axis));
}

Camera place_camera(const CameraWords& words, const Bounds3d& bounds, Vec3d up_axis, double aspect) {
  Camera camera;
  camera.view_angle = words.view_angle.value_or(kDefaultViewAngle);
  if (!(camera.view_angle > 0 && camera.view_angle < 180))
    refuse("the camera's view angle is not between 0 and 180 degrees");
  const Vec3d view_up = normalized(words.view_up.value_or(up_axis));
  if (!(length(view_up) > 0)) refuse("the camera's view up is zero");
  const Vec3d center = bounds.empty() ? Vec3d{} : bounds.center();
  camera.focal_point = words.focal_point.value_or(center);

  for (const Vec3d& p : {camera.focal_point, words.position.value_or(Vec3d{})})
    if (!(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) < kFarthest))
      refuse("the camera's position or focal point is too far away");

  const Vec3d front = words.position ? *words.position - camera.focal_point : front_of(up_axis);
  Frame frame = frame_of(front, view_up);
  const bool chosen = words.position || words.azimuth || words.elevation;
  // As f3d, which makes the view up orthogonal to the view before it turns (VTK alone would turn about
  // view_up).
  turn(frame, frame.up, words.azimuth.value_or(chosen ? 0 : kDefaultAzimuth));
  turn(frame, frame.right, -words.elevation.value_or(chosen ? 0 : kDefaultElevation));

  double distance = length(front);
  if (!words.position) {
    Corners corners{};
    for (unsigned i = 0; i < 8 && !bounds.empty(); ++i)
      corners[i] = Vec3d{i & 1 ? bounds.hi.x : bounds.lo.x, i & 2 ? bounds.hi.y : bounds.lo.y,
                         i & 4 ? bounds.hi.z : bounds.lo.z} -
                   camera.focal_point;
    const bool movable = !words.focal_point;
    const double slope = std::tan(camera.view_angle / 2 * kDegree) / kMargin;
    distance = std::max(fit_distance(corners, frame.right, frame.back, slope * aspect, movable),
                        fit_distance(corners, frame.up, frame.back, slope, movable));
    if (movable && distance > 0)
      camera.focal_point = camera.focal_point +
                           frame.right * fit_middle(corners, frame.right, frame.back, distance) +
                           frame.up * fit_middle(corners, frame.up, frame.back, distance);
    if (!(distance > 0)) distance = 1;  // a single point
  }
  camera.position = camera.focal_point + frame.back * distance;
  camera.up = frame.up;
  return camera;
}

std::vector<Camera> turntable(const Camera& base, Vec3d up, int count) {
  std::vector<Camera> cameras;
  const Vec3d axis = normalized(up);
  for (int i = 0; i < count; ++i) {
    const double degrees = 360.0 * i / count;
    Camera camera = base;
    camera.position = base.focal_point + rotate(base.position - base.focal_point, axis, degrees);
    camera.up = rotate(base.up, axis, degrees);
    cameras.push_back(camera);
  }
  return cameras;
}

CameraWords less_shift(CameraWords words, const Vec3d& shift) {
  for (std::optional<Vec3d>* point : {&words.position, &words.focal_point})
    if (*point) **point = **point - shift;
  return words;
}

std::vector<Camera> views_around(const Bounds3d& bounds, Vec3d up_axis, int count, double aspect) {
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    CameraWords words;
    words.azimuth = 360.0 * i / count;
    words.elevation = i % 2 == 0 ? 20 : -20;
    cameras.push_back(place_camera(words, bounds, up_axis, aspect));
  }
  return cameras;
}

CameraRays camera_rays(const Camera& camera, std::uint32_t width, std::uint32_t height, double offset_x,
                       double offset_y) {
  const Vec3d forward = normalized(camera.focal_point - camera.position);
  const Vec3d right = normalized(cross(forward, camera.up));
  const Vec3d up = cross(right, forward);
  const double half = std::tan(camera.view_angle / 2 * kDegree);
  const double pixel = 2 * half / height;
  const Vec3d corner = forward - right * (pixel * width / 2) + up * half;
  CameraRays rays{};
  rays.width = width;
  rays.height = height;
  rays.offset_x = static_cast<float>(offset_x);
  rays.offset_y = static_cast<float>(offset_y);
  for (int axis = 0; axis < 3; ++axis) {
    rays.position[axis] = static_cast<float>(camera.position[axis]);
    rays.corner[axis] = static_cast<float>(corner[axis]);
    rays.right[axis] = static_cast<float>(right[axis] * pixel);
    rays.up[axis] = static_cast<float>(-up[axis] * pixel);
  }
  return rays;
}

}  // namespace rbvh
