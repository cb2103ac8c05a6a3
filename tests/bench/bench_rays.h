// The rays that are timed: the same ones for every tracer, the same ones every run.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/common/layout.h"
#include "rbvh/geometry.h"

namespace rbvh::bench {

/// All rays of a camera, in squares of 4 x 4 pixels within squares of 8 x 8, so that 16 (and 64) in a row are
/// coherent. `width` and `height` are multiples of 8.
std::vector<Ray> primary_rays(const CameraRays& camera);

/// One cosine-weighted bounce from every hit of `rays`, on the side that was seen, starting `offset` off the
/// surface.
std::vector<Ray> diffuse_rays(const std::vector<Ray>& rays, const std::vector<Hit>& hits, float offset,
                              std::uint32_t seed);

}  // namespace rbvh::bench
