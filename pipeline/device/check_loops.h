// Refuses devices whose loops end early. Mesa's llvmpipe silently stops each after 65,535 iterations of a
// work-item: longer traversals and chunks of a scan would be cut, and pairs broken.
#pragma once

#include "pipeline/device/device.h"

namespace rbvh::device_detail {

/// Runs a loop of more iterations, once a process for each device. Throws Error(kDevice).
void check_loops(const Device& device);

}  // namespace rbvh::device_detail
