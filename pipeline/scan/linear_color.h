// Colours of scans in linear light.
#pragma once

#include <array>

#include "pipeline/base/srgb.h"
#include "rbvh/scan.h"

namespace rbvh {

inline Vec3f linear_color(const Color8& color) {
  static const std::array<float, 256> kTable = [] {
    std::array<float, 256> table{};
    for (std::size_t i = 0; i < 256; ++i) table[i] = srgb_to_linear(static_cast<float>(i) / 255);
    return table;
  }();
  return {kTable[color[0]], kTable[color[1]], kTable[color[2]]};
}

}  // namespace rbvh
