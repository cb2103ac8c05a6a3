// A picture of where a level differs from exact ray casting.
#pragma once

#include <span>

#include "pipeline/measure/fidelity.h"
#include "rbvh/image.h"
#include "rbvh/render.h"

namespace rbvh {

/// The exact surface in grey under a headlight, warmer where the depths differ (from 1e-5 of the diagonal to
/// 1e-2), and the faults on top: holes red, leaks magenta, walls yellow; mask mismatches at the silhouette
/// blue, elsewhere green. With `mark_radius` > 0 interior faults are grown to squares of that many pixels to
/// each side.
Image difference_image(std::span<const Hit> exact, std::span<const Hit> level, const CameraRays& rays,
                       float diagonal, int mark_radius = 0);

/// Where two tracers' hits of a camera's rays differ (difference_image()). `diagonal` is of what is cast at,
/// scan units; the number of pixels with another hit is added to `differing`.
Image render_difference(const Tracer& first, const Tracer& second, const Camera& camera, std::uint32_t width,
                        std::uint32_t height, float diagonal, std::uint64_t& differing,
                        RenderTimings* timings = nullptr);

}  // namespace rbvh
