#include "rbvh/image.h"

#include <algorithm>

#include "pipeline/base/parallel_for.h"
#include "pipeline/base/srgb.h"
#include "rbvh/image_bytes.h"

namespace rbvh {
namespace {

constexpr float kBackground = 0.82f;  // linear: a light grey

std::uint8_t to_byte(float shown) {
  return static_cast<std::uint8_t>(std::clamp(shown, 0.f, 1.f) * 255 + 0.5f);
}

}  // namespace

Image make_image(Image::Kind kind, std::uint32_t width, std::uint32_t height,
                 std::vector<std::string> channels) {
  Image image{kind, width, height, std::move(channels), {}};
  image.pixels.resize(std::size_t{width} * height * image.channels.size());
  return image;
}

// Alpha is premultiplied in the picture.
std::vector<std::uint8_t> image_bytes(const Image& image, std::size_t channels) {
  const std::size_t from = image.channels.size(), pixels = std::size_t{image.width} * image.height;
  const bool has_alpha = from == 4, is_color = image.kind == Image::Kind::kColor;
  std::vector<std::uint8_t> bytes(pixels * channels);
  parallel_for(pixels, 1 << 14, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const float* in = &image.pixels[i * from];
      const float alpha = has_alpha ? in[3] : 1;
      for (std::size_t c = 0; c < std::min<std::size_t>(channels, 3); ++c) {
        float value = in[std::min(c, from - 1)];
        if (has_alpha && channels == 4) value = alpha > 0 ? value / alpha : 0;
        if (has_alpha && channels == 3) value += (1 - alpha) * kBackground;
        bytes[i * channels + c] = to_byte(is_color ? linear_to_srgb(value) : value);
      }
      if (channels == 4) bytes[i * channels + 3] = to_byte(alpha);
    }
  });
  return bytes;
}

}  // namespace rbvh
