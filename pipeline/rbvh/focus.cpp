#include "pipeline/rbvh/focus.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace rbvh {

Focus place_focus(const FocusWords& words, const Scan& scan) {
  Focus focus{.center = Vec3f(words.point), .radius = 0, .level = words.level};
  if (words.radius) {
    focus.radius = static_cast<float>(*words.radius);
    return focus;
  }
  float nearest = std::numeric_limits<float>::infinity();
  for (const Vec3f& p : scan.positions) nearest = std::min(nearest, length(p - focus.center));
  focus.radius = std::max(nearest, 1e-3f * bounds(scan).diagonal());
  return focus;
}

LevelConfig quality_at(const LevelConfig& level, const Focus* focus, float distance) {
  if (focus == nullptr || !(focus->level.rho > level.rho)) return level;
  const LevelConfig& best = focus->level;
  const float relative = std::max(1.0f, distance / focus->radius);
  LevelConfig here = level;
  here.rho = std::max(level.rho, best.rho * std::exp2(-std::ceil(2 * std::log2(relative))));
  const float share = std::log(here.rho / level.rho) / std::log(best.rho / level.rho);
  here.alpha += share * (best.alpha - level.alpha);
  here.phi_degrees += share * (best.phi_degrees - level.phi_degrees);
  return here;
}

DistanceRange distances(const Bounds3f& box, Vec3f from) {
  Vec3f nearest{}, farthest{};
  for (int axis = 0; axis < 3; ++axis) {
    const float below = box.lo[axis] - from[axis], above = from[axis] - box.hi[axis];
    nearest[axis] = std::max({0.0f, below, above});
    farthest[axis] = std::max(std::abs(below), std::abs(above));
  }
  return {length(nearest), length(farthest)};
}

}  // namespace rbvh
