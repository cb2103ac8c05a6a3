// PNG files, read back by OpenImageIO.
#include "io/png.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <string>

namespace rbvh {
namespace {

enum class Content { kFlat, kRamp, kRows, kNoise };

std::vector<std::uint8_t> make_pixels(std::uint32_t width, std::uint32_t height, std::size_t channels,
                                      Content content) {
  std::vector<std::uint8_t> pixels(std::size_t{width} * height * channels);
  std::uint32_t random = 1;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    random = random * 1664525u + 1013904223u;
    const std::size_t x = i / channels % width, y = i / channels / width;
    pixels[i] = static_cast<std::uint8_t>(content == Content::kFlat   ? 200
                                          : content == Content::kRamp ? x * 3 + y * 5 + i % channels
                                          : content == Content::kRows ? y * 37 + (random >> 31)
                                                                      : random >> 24);
  }
  return pixels;
}

TEST(Png, ReadsBackAsItWas) {
  for (const std::size_t channels : {1u, 2u, 3u, 4u})
    for (const auto& [width, height] : {std::pair{1u, 1u}, {3u, 1u}, {1u, 70u}, {131u, 130u}})
      for (const Content content : {Content::kFlat, Content::kRamp, Content::kRows, Content::kNoise}) {
        const auto pixels = make_pixels(width, height, channels, content);
        std::vector<std::byte> bytes = encode_png(width, height, channels, pixels, true);
        OIIO::Filesystem::IOMemReader memory(bytes.data(), bytes.size());
        const auto in = OIIO::ImageInput::create("png");
        OIIO::ImageSpec spec, config;
        config.attribute("oiio:UnassociatedAlpha", 1);
        ASSERT_TRUE(in->set_ioproxy(&memory) && in->open("a.png", spec, config)) << in->geterror();
        EXPECT_EQ(spec.width, static_cast<int>(width));
        EXPECT_EQ(spec.height, static_cast<int>(height));
        EXPECT_EQ(spec.get_string_attribute("oiio:ColorSpace"), "sRGB");
        ASSERT_EQ(spec.nchannels, static_cast<int>(channels));
        std::vector<std::uint8_t> read(pixels.size());
        ASSERT_TRUE(in->read_image(0, 0, 0, -1, OIIO::TypeDesc::UINT8, read.data())) << in->geterror();
        EXPECT_EQ(read, pixels) << channels << " " << width << " " << static_cast<int>(content);
      }
}

TEST(Png, FiltersMakeRampsSmall) {
  const auto ramp = make_pixels(256, 256, 4, Content::kRamp);
  EXPECT_LT(encode_png(256, 256, 4, ramp, false).size(), ramp.size() / 50);
}

}  // namespace
}  // namespace rbvh
