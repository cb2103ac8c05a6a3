// The distance between two surfaces, both ways, by sampling (Cignoni, Rocchini, Scopigno, "Metro: measuring
// error on simplified surfaces", 1998).
#pragma once

#include <cstddef>

#include "pipeline/scan/closest_point.h"
#include "rbvh/measure.h"

namespace rbvh {

/// From points spread evenly over `from` (by area, the same ones every time) to the surface `to`.
DistanceStatistics sampled_distance(const TriangleSoup& from, const ClosestPoint& to, std::size_t samples);

}  // namespace rbvh
