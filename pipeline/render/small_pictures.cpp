#include "pipeline/render/small_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "pipeline/base/vector_math.h"
#include "rbvh/camera.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kSide = 80;  // pixels
constexpr double kViewAngle = 12;    // degrees
constexpr double kMargin = 1.02;
constexpr double kLevel = 0.94;     // least cosine between a level plane's normals and what is up
constexpr std::size_t kSlabs = 48;  // along an axis; a plane is what lies in two of them
constexpr double kLarger = 1.5;     // than the plane along the usual axis
constexpr double kPlane = 0.3;      // of what is seen from above: the least that is a plane

/// The most pixels of a picture from `up` whose surface is level and lies in one slab, as a part of those
/// that show any; which side is up matters: a floor faces the camera, a ceiling does not.
double level_share(const Tracer& tracer, const Asset& asset, Vec3d up) {
  const Vec3d view_up = std::abs(up.y) > 0.5 ? Vec3d{0, 0, 1} : Vec3d{0, 1, 0};
  const SmallPicture picture = small_picture(tracer, asset, up, view_up);
  std::array<double, kSlabs> slabs{};
  double seen = 0;
  float nearest = std::numeric_limits<float>::infinity(), farthest = 0;
  for (const Hit& hit : picture.hits)
    if (std::isfinite(hit.t)) {
      nearest = std::min(nearest, hit.t);
      farthest = std::max(farthest, hit.t);
    }
  for (const Hit& hit : picture.hits) {
    if (!std::isfinite(hit.t)) continue;
    seen += 1;
    if (dot(static_cast<Vec3d>(array3(hit.normal)), up) < kLevel) continue;
    const float place = farthest > nearest ? (hit.t - nearest) / (farthest - nearest) : 0;
    slabs[std::min(kSlabs - 1, static_cast<std::size_t>(place * static_cast<float>(kSlabs)))] += 1;
  }
  double most = 0;
  for (std::size_t i = 0; i + 1 < kSlabs; ++i) most = std::max(most, slabs[i] + slabs[i + 1]);
  return seen > 0 ? most / seen : 0;
}

}  // namespace

SmallPicture small_picture(const Tracer& tracer, const Asset& asset, Vec3d from, Vec3d up) {
  const Vec3d center = static_cast<Vec3d>(asset.bounds.center());
  const double radius = std::max(1e-30, static_cast<double>(asset.bounds.diagonal()) / 2);
  const double distance = kMargin * radius / std::sin(kViewAngle / 2 * std::numbers::pi / 180);
  const Camera camera{center + normalized(from) * distance, center, up, kViewAngle};
  SmallPicture picture{camera_rays(camera, kSide, kSide), {}};
  picture.hits = intersect(tracer, picture.rays);
  return picture;
}

Vec3d find_up(const Tracer& tracer, const Asset& asset, std::string& text) {
  const Vec3d usual = asset.up_axis();
  if (!asset.is_cloud) return usual;
  struct Axis {
    Vec3d up;
    const char* name;
  };
  constexpr Axis kAxes[] = {{{0, 0, 1}, "+Z"}, {{0, 1, 0}, "+Y"}, {{0, -1, 0}, "-Y"}, {{0, 0, -1}, "-Z"}};
  const double least = std::max(kPlane, kLarger * level_share(tracer, asset, usual));
  double most = least;
  Vec3d up = usual;
  for (const Axis& axis : kAxes) {
    if (axis.up == usual) continue;
    const double share = level_share(tracer, asset, axis.up);
    if (!(share > most)) continue;
    most = share;
    up = axis.up;
    text = std::string("; ") + axis.name + " is up, by the largest level plane";
  }
  return up;
}

}  // namespace rbvh
