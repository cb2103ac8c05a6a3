// Thins a cloud to one point per voxel.
#pragma once

#include <cstddef>

#include "pipeline/scan/scan.h"

namespace rbvh {

/// Keeps, of the points in each cube of side `size` (scan units, > 0), the one nearest to their mean: a
/// measured point with all its attributes. PCL's grid would average positions, drop the attributes and give
/// up where its 32-bit cell numbers overflow. Radii no longer hold afterwards and are dropped. Needs finite
/// positions. Returns the number of removed points.
std::size_t thin_cloud(Scan& scan, double size);

}  // namespace rbvh
