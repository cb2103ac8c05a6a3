#include "pipeline/render/image.h"

#include <cmath>

namespace rbvh {

Image make_image(Image::Kind kind, std::uint32_t width, std::uint32_t height,
                 std::vector<std::string> channels) {
  Image image{kind, width, height, std::move(channels), {}};
  image.pixels.resize(std::size_t{width} * height * image.channels.size());
  return image;
}

float linear_to_srgb(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}

float srgb_to_linear(float srgb) {
  return srgb <= 0.04045f ? srgb / 12.92f : std::pow((srgb + 0.055f) / 1.055f, 2.4f);
}

}  // namespace rbvh
