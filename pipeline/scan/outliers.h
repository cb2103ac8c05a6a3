// Stray points: those whose neighbours are unusually far away (PCL's statistical outlier removal).
#pragma once

#include <cstddef>

#include "pipeline/scan/scan.h"

namespace rbvh {

/// Removes vertices whose mean distance to their `neighbors` nearest is more than `sigma` standard deviations
/// above the mean of all. Faces at them are removed too. Needs finite positions. Returns the number of
/// removed vertices.
std::size_t remove_outliers(Scan& scan, std::size_t neighbors, double sigma);

}  // namespace rbvh
