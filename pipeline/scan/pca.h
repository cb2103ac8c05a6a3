// The plane through a handful of points: principal components in closed form.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "pipeline/base/vec.h"

namespace rbvh {

struct PrincipalComponents {
  std::array<double, 3> variances{};  ///< ascending
  Vec3d normal{0, 0, 1};              ///< unit, along the least variance; its sign is arbitrary
};

/// Of the point `self` and `others`, indices into `points`. Points on a line get some normal across it, equal
/// points +z.
PrincipalComponents principal_components(std::span<const Vec3f> points, std::size_t self,
                                         std::span<const std::uint32_t> others);

}  // namespace rbvh
