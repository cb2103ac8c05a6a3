// sRGB's transfer curve (IEC 61966-2-1).
#pragma once

#include <cmath>

namespace rbvh {

/// One channel value between linear light and sRGB's curve, both in [0, 1].
inline float linear_to_srgb(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}

inline float srgb_to_linear(float srgb) {
  return srgb <= 0.04045f ? srgb / 12.92f : std::pow((srgb + 0.055f) / 1.055f, 2.4f);
}

}  // namespace rbvh
