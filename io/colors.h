// Colours as files have them: bytes, 16-bit words, or floats in [0, 1] or [0, 255].
#pragma once

#include <span>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// 0..255, rounded; NaN is 0.
inline std::uint8_t to_color_byte(double value) {
  return value >= 255.0 ? 255 : value > 0.0 ? static_cast<std::uint8_t>(value + 0.5) : 0;
}

/// The scale is told from the largest value: at most 1 is a fraction, at most 255 a byte, else a 16-bit word.
inline std::vector<Color8> colors_from_floats(std::span<const Vec3f> colors) {
  float largest = 0;
  for (const Vec3f& c : colors)
    for (int i = 0; i < 3; ++i)
      if (c[i] > largest) largest = c[i];
  const double scale = largest <= 1.0f ? 255.0 : largest <= 255.0f ? 1.0 : 255.0 / 65535.0;
  std::vector<Color8> bytes(colors.size());
  for (std::size_t i = 0; i < colors.size(); ++i)
    for (int c = 0; c < 3; ++c) bytes[i][static_cast<std::size_t>(c)] = to_color_byte(colors[i][c] * scale);
  return bytes;
}

}  // namespace rbvh
