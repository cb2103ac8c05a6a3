// The boxes that exact hierarchies are built over.
#pragma once

#include <vector>

#include "rbvh/geometry.h"
#include "rbvh/scan.h"

namespace rbvh {

/// The box of every triangle or, in a cloud, disc; empty for one that can never be hit: not finite, without
/// area, normal or radius.
std::vector<Bounds3f> primitive_bounds(const Scan& scan);

}  // namespace rbvh
