// Noise taken out of a picture of few samples, along the surfaces that are seen in it.
#pragma once

#include <vector>

#include "rbvh/geometry.h"
#include "rbvh/image.h"

namespace rbvh {

/// What is seen in a pixel.
struct DenoiseGuide {
  Vec3f normal{};  ///< unit; zero: nothing is seen
  Vec3f albedo{};
  float depth = 0;     ///< distance from the camera
  float variance = 0;  ///< of the pixel's luminance
};

/// An edge-avoiding a-trous wavelet (Dammertz et al. 2010) of five steps over the light, that is the colour
/// over the albedo. Differences within the variance, which is filtered along, are noise (as in Schied et al.
/// 2017); alpha stays.
void denoise(Image& color, std::vector<DenoiseGuide> guides);

}  // namespace rbvh
