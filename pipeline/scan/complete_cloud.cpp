#include "pipeline/scan/complete_cloud.h"

#include <algorithm>

#include "pipeline/base/error.h"
#include "pipeline/scan/neighbors.h"
#include "pipeline/scan/normals.h"
#include "pipeline/scan/radii.h"

namespace rbvh {
namespace {

/// A default viewpoint further off than this many diagonals is the origin of a map, no sensor.
constexpr double kFarthestDefault = 16;
/// Least visible_share() of a cloud that is believed to be seen from its default viewpoint.
constexpr double kVisible = 0.5;

/// The finite points of a scan, side by side.
struct FinitePoints {
  std::vector<std::uint32_t> index;  ///< in the scan
  std::vector<Vec3f> points, normals;
  std::vector<std::uint8_t> missing, fixed;  ///< the normal is to be estimated; is given
  Bounds3f box;
};

FinitePoints finite_points(const Scan& scan) {
  FinitePoints finite;
  for (std::size_t i = 0; i < scan.positions.size(); ++i) {
    if (!is_finite(scan.positions[i])) continue;
    finite.index.push_back(static_cast<std::uint32_t>(i));
    finite.points.push_back(scan.positions[i]);
    finite.box.add(scan.positions[i]);
    const bool given = !scan.normals.empty() && is_direction(scan.normals[i]);
    finite.normals.push_back(given ? normalized(scan.normals[i]) : Vec3f{});
    finite.missing.push_back(!given);
    finite.fixed.push_back(given);
  }
  return finite;
}

bool believed(const Viewpoint& viewpoint, const FinitePoints& finite, const Neighbors& neighbors,
              std::span<const std::uint8_t> asked) {
  if (!viewpoint.is_default) return true;
  const Vec3d centre = static_cast<Vec3d>(finite.box.center());
  if (length(viewpoint.position - centre) > kFarthestDefault * static_cast<double>(finite.box.diagonal()))
    return false;
  return visible_share(finite.points, neighbors, finite.normals, asked,
                       static_cast<Vec3f>(viewpoint.position)) >= kVisible;
}

/// Turns the estimated normals of the points that `viewpoint` is for towards it.
std::size_t face_viewpoint(const Scan& scan, const Viewpoint& viewpoint, const Neighbors& neighbors,
                           FinitePoints& finite) {
  std::vector<std::uint8_t> asked(finite.points.size());
  for (std::size_t i = 0; i < asked.size(); ++i) {
    const std::int32_t id = scan.object_ids.empty() ? 0 : scan.object_ids[finite.index[i]];
    asked[i] = finite.missing[i] && viewpoint.first_object <= id && id <= viewpoint.last_object;
  }
  if (!believed(viewpoint, finite, neighbors, asked)) return 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < asked.size(); ++i) {
    if (!asked[i]) continue;
    ++count;
    if (dot(static_cast<Vec3d>(finite.normals[i]),
            viewpoint.position - static_cast<Vec3d>(finite.points[i])) < 0)
      finite.normals[i] = -finite.normals[i];
  }
  return count;
}

}  // namespace

CloudCounts complete_cloud(Scan& scan, const CloudConfig& config, const Progress& progress) {
  CloudCounts counts;
  if (!scan.is_cloud()) return counts;
  FinitePoints finite = finite_points(scan);
  const auto usable = [](float radius) { return std::isfinite(radius) && radius > 0; };
  const bool has_radii =
      !scan.radii.empty() && std::all_of(finite.index.begin(), finite.index.end(),
                                         [&](std::uint32_t i) { return usable(scan.radii[i]); });
  counts.normals_estimated =
      static_cast<std::size_t>(std::count(finite.missing.begin(), finite.missing.end(), std::uint8_t{1}));

  Neighbors neighbors;
  if (counts.normals_estimated > 0 || !has_radii)
    neighbors = find_neighbors(finite.points, std::max<std::size_t>(3, config.neighbors), progress);
  if (counts.normals_estimated > 0) {
    report(progress, "normals", 0);
    estimate_normals(finite.points, neighbors, finite.missing, finite.normals);
    report(progress, "normals", 0.4);
    propagate_orientation(finite.points, neighbors, finite.fixed, finite.normals);
    report(progress, "normals", 0.8);
    if (config.viewpoint) {
      counts.normals_by_viewpoint = face_viewpoint(scan, {.position = *config.viewpoint}, neighbors, finite);
    } else {
      for (const Viewpoint& viewpoint : scan.viewpoints)
        counts.normals_by_viewpoint += face_viewpoint(scan, viewpoint, neighbors, finite);
    }
    report(progress, "normals", 1);
  }
  scan.normals.assign(scan.positions.size(), Vec3f{});
  for (std::size_t i = 0; i < finite.index.size(); ++i) scan.normals[finite.index[i]] = finite.normals[i];

  scan.radii.resize(scan.positions.size(), 0.0f);
  if (!has_radii) {
    report(progress, "radii", 0);
    const std::vector<float> radii = estimate_radii(finite.points, finite.normals, neighbors);
    for (std::size_t i = 0; i < radii.size(); ++i) {
      float& radius = scan.radii[finite.index[i]];
      if (usable(radius)) continue;
      radius = radii[i];
      ++counts.radii_estimated;
    }
    report(progress, "radii", 1);
  }
  return counts;
}

}  // namespace rbvh
