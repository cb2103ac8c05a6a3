// A picture of where a level differs from exact ray casting.
#pragma once

#include <span>

#include "pipeline/measure/fidelity.h"
#include "rbvh/image.h"

namespace rbvh {

/// The exact surface in grey under a headlight, warmer where the depths differ (from 1e-5 of the diagonal to
/// 1e-2), and the faults on top: holes red, leaks magenta, walls yellow; mask mismatches at the silhouette
/// blue, elsewhere green. With `mark_radius` > 0 interior faults are grown to squares of that many pixels to
/// each side.
Image difference_image(std::span<const Hit> exact, std::span<const Hit> level, const CameraRays& rays,
                       float diagonal, int mark_radius = 0);

}  // namespace rbvh
