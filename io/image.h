// Pictures out, by the name's extension: PNG by io/png.h, JPEG and EXR by OpenImageIO. Equal pictures give
// equal bytes.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "rbvh/image.h"
#include "rbvh/io.h"

namespace rbvh {

enum class ImageFormat { kPng, kJpeg, kExr };

/// By extension (.png .jpg .jpeg .exr, any case). A stream ("-", a device, a pipe) has none: EXR for data,
/// else PNG. Throws Error(kUsage) for any other extension, and for data (Image::Kind::kData) in a format of 8
/// bits.
ImageFormat image_format(const std::string& path, Image::Kind kind);

/// The bytes of a PNG file: 8 bits a channel, straight alpha.
std::vector<std::byte> encode_image_png(const Image& image);

/// A GIF that shows pictures of one size and kind one after the other, 12 a second, for ever. Throws
/// Error(kFailure).
void write_movie(const std::string& path, std::span<const Image> frames, bool overwrite);

}  // namespace rbvh
