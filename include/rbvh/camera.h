// Cameras in f3d's words: position, focal point, view up, view angle, then azimuth and elevation on top, as
// VTK turns them.
#pragma once

#include <optional>
#include <vector>

#include "rbvh/geometry.h"
#include "rbvh/ray.h"

#pragma GCC visibility push(default)
namespace rbvh {

/// What a user may say. What is given is used unchanged; what is not is chosen by place_camera().
struct CameraWords {
  std::optional<Vec3d> position, focal_point, view_up;
  std::optional<double> view_angle;  ///< degrees, vertical, full angle
  std::optional<double> azimuth;     ///< degrees about the camera's own up axis; positive: to the right
  std::optional<double> elevation;   ///< degrees about the camera's right axis; positive: upwards
};

/// A camera that can see: position != focal point, `up` unit and at right angles to the view.
struct Camera {
  Vec3d position, focal_point, up;
  double view_angle = 30;  ///< degrees, vertical, full angle
};

/// From an object to a camera in front of it, unit: +Z where +Y is up, -Y where +Z is.
Vec3d front_of(Vec3d up_axis);

/// Fills in the words that are missing: the view angle is 30 degrees, the view up is `up_axis`, the focal
/// point the middle of the picture of `bounds`, the position as near as shows all of `bounds`, in front of
/// the object (front_of()) or, with none of position, azimuth and
/// elevation given, in a three-quarter view (azimuth 30, elevation 20). `aspect` is width / height. Throws
/// Error(kUsage) where position and focal point coincide, the view runs along the view up, or the angle is
/// not between 0 and 180.
Camera place_camera(const CameraWords& words, const Bounds3d& bounds, Vec3d up_axis, double aspect);

/// `count` cameras, turned about the axis `up` through the focal point in equal steps; the first is `base`.
std::vector<Camera> turntable(const Camera& base, Vec3d up, int count);

/// Position and focal point less `shift`: from the file's coordinates to inner ones (rbvh/frame.h).
CameraWords less_shift(CameraWords words, const Vec3d& shift);

/// `count` cameras around an object, alternately 20 degrees above and below it, each with the object filling
/// a frame of that aspect.
std::vector<Camera> views_around(const Bounds3d& bounds, Vec3d up_axis, int count, double aspect);

/// The rays of an image. The offsets say where in the pixel a ray passes; 0.5 is the centre.
CameraRays camera_rays(const Camera& camera, std::uint32_t width, std::uint32_t height, double offset_x = 0.5,
                       double offset_y = 0.5);

}  // namespace rbvh
#pragma GCC visibility pop
