// PNG (ISO/IEC 15948), written without OpenImageIO, which takes longer to load than a preview takes to ray
// cast.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace rbvh {

/// The file's bytes, of 8 bits a channel: 1 to 4 channels (grey, with alpha, RGB, with alpha). `is_srgb` is
/// noted in it. Equal pixels give equal bytes.
std::vector<std::byte> encode_png(std::uint32_t width, std::uint32_t height, std::size_t channels,
                                  std::span<const std::uint8_t> pixels, bool is_srgb);

}  // namespace rbvh
