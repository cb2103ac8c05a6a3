// A picture in memory, before a file format is chosen for it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/base/srgb.h"

namespace rbvh {

/// Floats, row by row from the top left, channels interleaved.
struct Image {
  /// How the values are meant, and with it how io/image.h turns them into 8 bits.
  enum class Kind {
    kColor,  ///< linear light, R G B [A], alpha premultiplied; 8-bit files get sRGB
    kShown,  ///< already as it is to be shown, in [0, 1]; 8-bit files get it unchanged
    kData,   ///< distances, positions, numbers: not for 8-bit files
  };
  Kind kind = Kind::kColor;
  std::uint32_t width = 0, height = 0;
  std::vector<std::string> channels;
  std::vector<float> pixels;

  float* at(std::size_t x, std::size_t y) { return &pixels[(y * width + x) * channels.size()]; }
  const float* at(std::size_t x, std::size_t y) const { return &pixels[(y * width + x) * channels.size()]; }
};

/// Zeroed.
Image make_image(Image::Kind kind, std::uint32_t width, std::uint32_t height,
                 std::vector<std::string> channels);

}  // namespace rbvh
