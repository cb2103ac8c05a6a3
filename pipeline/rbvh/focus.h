// Quality that differs from place to place (section 3.5 of the paper): finest around a point of interest,
// falling with the distance from it as what a viewer there could tell apart does, down to the level's own.
#pragma once

#include "pipeline/base/vec.h"
#include "pipeline/rbvh/level_config.h"

namespace rbvh {

struct Focus {
  Vec3f center{};
  float radius = 0;   ///< within it the quality is `level`'s; scan units, > 0
  LevelConfig level;  ///< a level that is finer than this one stays as it is
};

/// What a level asks for at this distance from the focus (none: the level's own). Texels grow in proportion
/// to the distance; rho falls in steps of 2, so that neighbouring tiles differ by no more, or not at all.
LevelConfig quality_at(const LevelConfig& level, const Focus* focus, float distance);

/// The nearest and the farthest that a point of the box can be.
struct DistanceRange {
  float nearest = 0, farthest = 0;
};
DistanceRange distances(const Bounds3f& box, Vec3f from);

}  // namespace rbvh
