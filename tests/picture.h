// Pictures that the tool wrote, as floats.
#pragma once

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace rbvh {

struct Picture {
  int width = 0, height = 0, channels = 0;
  std::vector<std::string> names;
  std::vector<float> pixels;
  const float* at(int x, int y) const {
    return &pixels[static_cast<std::size_t>((y * width + x) * channels)];
  }
};

inline Picture read_picture(const std::string& path) {
  const auto in = OIIO::ImageInput::open(path);
  EXPECT_TRUE(in) << path;
  if (!in) return {};
  const OIIO::ImageSpec& spec = in->spec();
  Picture p{spec.width, spec.height, spec.nchannels, spec.channelnames, {}};
  p.pixels.resize(static_cast<std::size_t>(p.width * p.height * p.channels));
  EXPECT_TRUE(in->read_image(0, 0, 0, -1, OIIO::TypeDesc::FLOAT, p.pixels.data()));
  return p;
}

}  // namespace rbvh
