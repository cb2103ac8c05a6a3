// What a level's error came to, where its construction does not bound it.
#pragma once

#include "pipeline/device/device.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// The rms distance from points of the scan to the level, scan units: from one in each of 16 thousand
/// triangles at equal steps, by area, or from as many points of a cloud. To a tile it is measured along its
/// normal, which is no less; a point further away counts as a texel away. 0: the scan has no area. The device
/// serves for tiles.
double sampled_error(const Device& device, const Level& level, const Scan& scan);

}  // namespace rbvh
