#include "pipeline/render/image.h"

namespace rbvh {

Image make_image(Image::Kind kind, std::uint32_t width, std::uint32_t height,
                 std::vector<std::string> channels) {
  Image image{kind, width, height, std::move(channels), {}};
  image.pixels.resize(std::size_t{width} * height * image.channels.size());
  return image;
}

}  // namespace rbvh
