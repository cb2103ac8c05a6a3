// A picture's file as bytes in memory, by OpenImageIO. Its writers do not report every failed write:
// OutputFile writes the bytes, and does.
#pragma once

#include <OpenImageIO/imageio.h>

#include <cstddef>
#include <string>
#include <vector>

namespace rbvh {

/// `format`: "png", "jpeg" or "openexr". `pixels`: spec.width * spec.height * spec.nchannels values of
/// `type`. Throws Error(kFailure), naming `path`.
std::vector<unsigned char> encode_image(const char* format, const OIIO::ImageSpec& spec, OIIO::TypeDesc type,
                                        const void* pixels, const std::string& path);

}  // namespace rbvh
