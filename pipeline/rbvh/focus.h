// Quality that varies over the scan (section 3.5 of the paper): finest around a point of interest, then
// falling with the distance, as the resolution of a viewer there does, down to the level's own.
#pragma once

#include <optional>

#include "rbvh/build.h"
#include "rbvh/geometry.h"

namespace rbvh {

/// What a user may say.
struct FocusWords {
  Vec3d point{};  ///< of interest, or where the camera stands; in the scan's coordinates
  bool is_camera = false;
  std::optional<double> radius;  ///< scan units; may be missing of a camera
  LevelConfig level = standard_levels()[0];
};

/// Where the radius of a camera's focus is missing, it reaches the nearest of the scan's vertices.
Focus place_focus(const FocusWords& words, const Scan& scan);

/// The level's quality at this distance from the focus (none: the level's own). Texels grow in proportion to
/// the distance; rho falls in steps of 2, so that neighbouring tiles differ by one step or not at all.
LevelConfig quality_at(const LevelConfig& level, const Focus* focus, float distance);

/// The distances of the box's nearest and farthest point.
struct DistanceRange {
  float nearest = 0, farthest = 0;
};
DistanceRange distances(const Bounds3f& box, Vec3f from);

}  // namespace rbvh
