// The 16-bit codes of a user's layer: 1..65535 evenly over the layer's range, 0: no value.
#pragma once

#include <cstdint>
#include <span>

#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// The value of a code that is not 0.
float decode(const Layer& layer, std::uint16_t code);

/// 0 for a value that is not finite; values outside the range are clamped.
std::uint16_t encode(const Layer& layer, float value);

/// Sets all channels of the given texels (by pixel, not channel); NaN: no value. The range grows to hold the
/// values, and those that were there are kept to half a step of the larger range. Throws Error(kInput) where
/// the range would overflow a float.
void set_values(Layer& layer, std::span<const std::size_t> texels, std::span<const float> values);

}  // namespace rbvh
