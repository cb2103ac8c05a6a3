// What is subtracted from coordinates before they become float.
#pragma once

#include "rbvh/geometry.h"

namespace rbvh {

/// The middle of `box`, rounded so that it prints exactly, where the largest coordinate is more than 16
/// diagonals away from the origin; else zero.
Vec3d float_shift(const Bounds3d& box);

}  // namespace rbvh
