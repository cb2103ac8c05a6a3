// Pictures of where levels differ from the scan.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "rbvh/measure.h"

namespace rbvh {

/// For MeasureConfig.on_view: writes each view of each of `levels` as <level>-<view>.png to `folder`, which
/// is made here. `diagonal` is the scan's. Throws Error(kFailure).
std::function<void(const MeasuredView&)> difference_writer(const std::string& folder,
                                                           const std::vector<std::string>& levels,
                                                           float diagonal, bool overwrite);

}  // namespace rbvh
