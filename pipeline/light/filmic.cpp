#include <algorithm>

#include "pipeline/base/error.h"
#include "rbvh/light.h"

namespace rbvh {
namespace {

constexpr float kExposure = 0.6f;

float filmic(float light) {
  const float x = std::max(0.f, light) * kExposure;
  return std::min(1.f, x * (2.51f * x + 0.03f) / (x * (2.43f * x + 0.59f) + 0.14f));
}

}  // namespace

void apply_filmic_curve(Image& color) {
  RBVH_CHECK(color.channels.size() == 4);
  for (std::size_t i = 0; i < color.pixels.size(); i += 4) {
    const float alpha = color.pixels[i + 3];
    for (std::size_t c = i; c < i + 3 && alpha > 0; ++c)
      color.pixels[c] = filmic(color.pixels[c] / alpha) * alpha;
  }
}

}  // namespace rbvh
