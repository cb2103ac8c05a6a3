// Refuses devices whose loops end early. Mesa's llvmpipe silently stops each after 65,535 iterations of a
// work-item: longer traversals and chunks of a scan would be cut, and pairs broken.
#pragma once

#include "pipeline/device/device.h"

namespace rbvh::device_detail {

/// Whether check_loops() has passed in this process.
bool are_loops_checked(const Device& device);

/// Runs a loop of more iterations: `kernel` is check_loops, which every program has
/// (kernels/common/check_loops.cl). Throws Error(kDevice).
void check_loops(const Device& device, const Kernel& kernel);

}  // namespace rbvh::device_detail
