#include "pipeline/render/pixels.h"

#include <algorithm>
#include <cmath>

namespace rbvh {

bool shows_nothing(const Image& image) {
  const std::size_t channels = image.channels.size();
  if (image.kind == Image::Kind::kData && (image.channels[0] == "Z" || image.channels[0] == "P.X"))
    return std::none_of(image.pixels.begin(), image.pixels.end(), [](float v) { return std::isfinite(v); });
  if (image.kind != Image::Kind::kColor || channels != 4) return false;
  for (std::size_t i = 3; i < image.pixels.size(); i += 4)
    if (image.pixels[i] != 0) return false;
  return true;
}

void add_to_pixels(Image& image, Vec3f value) {
  const std::size_t channels = image.channels.size();
  if (value == Vec3f{} || channels < 3) return;
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    if (i % channels < 3) image.pixels[i] += value[static_cast<int>(i % channels)];
}

}  // namespace rbvh
