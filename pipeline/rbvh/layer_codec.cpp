#include "pipeline/rbvh/layer_codec.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <utility>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

constexpr float kMostCode = 65534;  // codes 1..65535

void grow_range(Layer& layer, std::span<const float> values) {
  float lo = std::numeric_limits<float>::max(), hi = std::numeric_limits<float>::lowest();
  const bool is_empty =
      std::all_of(layer.texels.begin(), layer.texels.end(), [](auto code) { return code == 0; });
  if (!is_empty) {
    lo = layer.lo;
    hi = layer.hi;
  }
  for (const float value : values) {
    if (!std::isfinite(value)) continue;
    lo = std::min(lo, value);
    hi = std::max(hi, value);
  }
  if (lo > hi || (!is_empty && lo == layer.lo && hi == layer.hi)) return;
  // A single value becomes one end of a range: an empty range would mean that values are as stored.
  if (lo == hi) hi = lo + std::max(1.0f, std::abs(lo));
  if (lo > 0 && std::isinf(hi)) hi = std::exchange(lo, 0.0f);
  if (std::isinf(hi - lo)) {
    char range[64];
    std::snprintf(range, sizeof range, "%g to %g", static_cast<double>(lo), static_cast<double>(hi));
    throw Error(ErrorKind::kInput, "",
                "layer " + layer.name + " would have values from " + range +
                    ", further apart than a float can say; bring them closer together");
  }
  Layer grown;
  grown.lo = lo;
  grown.hi = hi;
  if (!is_empty)
    for (std::uint16_t& code : layer.texels)
      if (code != 0) code = encode(grown, decode(layer, code));
  layer.lo = lo;
  layer.hi = hi;
}

}  // namespace

float decode(const Layer& layer, std::uint16_t code) {
  if (layer.lo == layer.hi) return static_cast<float>(code);
  return layer.lo + (layer.hi - layer.lo) * (static_cast<float>(code - 1) / kMostCode);
}

std::uint16_t encode(const Layer& layer, float value) {
  if (!std::isfinite(value)) return 0;
  if (!(layer.hi > layer.lo)) return 1;
  const float at = (value - layer.lo) / (layer.hi - layer.lo);
  return static_cast<std::uint16_t>(1.5f + std::clamp(at, 0.0f, 1.0f) * kMostCode);
}

void set_values(Layer& layer, std::span<const std::size_t> texels, std::span<const float> values) {
  RBVH_CHECK(texels.size() * layer.channels == values.size());
  grow_range(layer, values);
  for (std::size_t i = 0; i < texels.size(); ++i) {
    std::uint16_t* codes = layer.texels.data() + texels[i] * layer.channels;
    const float* from = values.data() + i * layer.channels;
    // A texel has all its channels or none.
    const bool has_value = std::all_of(from, from + layer.channels, [](float v) { return std::isfinite(v); });
    for (std::size_t c = 0; c < layer.channels; ++c) codes[c] = has_value ? encode(layer, from[c]) : 0;
  }
}

}  // namespace rbvh
