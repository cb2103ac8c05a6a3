// What can be told of a picture by its pixels alone, and done to them.
#pragma once

#include "rbvh/geometry.h"
#include "rbvh/image.h"

namespace rbvh {

/// No ray of it hit anything: known of shaded pictures (no alpha), depths and positions (not finite).
bool shows_nothing(const Image& image);

/// Adds to the first three channels; what is infinite stays so.
void add_to_pixels(Image& image, Vec3f value);

}  // namespace rbvh
