// A picture as 8-bit files have it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "rbvh/image.h"

#pragma GCC visibility push(default)
namespace rbvh {

/// `channels` (1, 3 or 4) bytes a pixel: sRGB of colours; straight alpha with 4 channels, a light grey behind
/// with 3. Not for data.
std::vector<std::uint8_t> image_bytes(const Image& image, std::size_t channels);

}  // namespace rbvh
#pragma GCC visibility pop
