// Pictures out, by OpenImageIO: PNG, JPEG or EXR by the name's extension. Equal pictures give equal bytes.
#pragma once

#include <string>

#include "pipeline/render/image.h"

namespace rbvh {

enum class ImageFormat { kPng, kJpeg, kExr };

/// By extension (.png .jpg .jpeg .exr, any case). A stream ("-", a device, a pipe) has none: EXR for data,
/// else PNG. Throws Error(kUsage) for any other extension, and for data (Image::Kind::kData) in a format of 8
/// bits.
ImageFormat image_format(const std::string& path, Image::Kind kind);

/// PNG: 8 bits a channel, straight alpha. JPEG: quality 92, no alpha: a light background shows through. EXR:
/// 32-bit float channels under the picture's own names, ZIP. Written whole or not at all ("-": standard
/// output). Throws Error(kFailure) where it cannot be, Error(kUsage) as above.
void write_image(const std::string& path, const Image& image, bool overwrite);

}  // namespace rbvh
