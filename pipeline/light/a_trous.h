// The taps of an a-trous wavelet (Dammertz et al. 2010, "Edge-Avoiding A-Trous Wavelet Transform").
#pragma once

#include <cmath>
#include <cstddef>

namespace rbvh {

/// Calls f(pixel, weight) for the 5 x 5 pixels around (x, y), `spacing` apart, that lie within the picture;
/// the weights are those of the B3 spline.
template <class F>
void for_each_tap(std::ptrdiff_t width, std::ptrdiff_t height, std::ptrdiff_t x, std::ptrdiff_t y,
                  std::ptrdiff_t spacing, F&& f) {
  constexpr float kSpline[3] = {3.f / 8, 1.f / 4, 1.f / 16};  // by distance
  for (std::ptrdiff_t dy = -2; dy <= 2; ++dy)
    for (std::ptrdiff_t dx = -2; dx <= 2; ++dx) {
      const std::ptrdiff_t nx = x + dx * spacing, ny = y + dy * spacing;
      if (nx < 0 || ny < 0 || nx >= width || ny >= height) continue;
      f(static_cast<std::size_t>(ny * width + nx), kSpline[std::abs(dx)] * kSpline[std::abs(dy)]);
    }
}

}  // namespace rbvh
