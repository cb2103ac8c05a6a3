// Where a surface ends.
#pragma once

#include <cstddef>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// Of `count` vertices whether the surface is open there: around the others each neighbour follows one and
/// precedes one.
std::vector<bool> open_vertices(std::size_t count, const std::vector<Triangle>& triangles);

}  // namespace rbvh
