#include "pipeline/measure/image_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "pipeline/base/srgb.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kSize = 64;

Image picture(const std::function<float(std::uint32_t x, std::uint32_t y)>& srgb) {
  Image image = make_image(Image::Kind::kColor, kSize, kSize, {"R", "G", "B", "A"});
  for (std::uint32_t y = 0; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x) {
      for (int c = 0; c < 3; ++c) image.at(x, y)[c] = srgb_to_linear(srgb(x, y));
      image.at(x, y)[3] = 1;
    }
  return image;
}

float waves(std::uint32_t x, std::uint32_t y) {
  return 0.5f + 0.2f * std::sin(0.4f * static_cast<float>(x)) * std::cos(0.3f * static_cast<float>(y));
}

TEST(ImageError, EqualPicturesHaveNone) {
  const ImageError e = compare_images(picture(waves), picture(waves));
  EXPECT_EQ(e.rmse, 0);
  EXPECT_TRUE(std::isinf(e.psnr));
  EXPECT_NEAR(e.ssim, 1, 1e-5);
}

TEST(ImageError, AConstantOffsetIsTheRmse) {
  const ImageError e = compare_images(
      picture(waves), picture([](std::uint32_t x, std::uint32_t y) { return waves(x, y) + 0.1f; }));
  EXPECT_NEAR(e.rmse, 0.1, 1e-4);
  EXPECT_NEAR(e.psnr, 20, 0.02);
  EXPECT_GT(e.ssim, 0.8);  // the structure is the same
}

TEST(ImageError, LostStructureLowersSsim) {
  const ImageError e =
      compare_images(picture(waves), picture([](std::uint32_t, std::uint32_t) { return 0.5f; }));
  EXPECT_LT(e.ssim, 0.2);
}

TEST(ImageError, OnlyCoveredPixelsCount) {
  Image a = picture(waves), b = picture(waves);
  b.at(10, 10)[0] = 1;
  const double all = compare_images(a, b).rmse;
  for (std::uint32_t y = 32; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x)
      for (Image* image : {&a, &b}) std::fill_n(image->at(x, y), 4, 0.f);
  EXPECT_NEAR(compare_images(a, b).rmse, all * std::sqrt(2), 1e-6);
  const Image empty = make_image(Image::Kind::kColor, kSize, kSize, {"R", "G", "B", "A"});
  EXPECT_EQ(compare_images(empty, empty).ssim, 1);
}

// A variance is the difference of two means: rounding must not take it, and with it SSIM, out of range.
TEST(ImageError, SsimIsAtMostOne) {
  std::minstd_rand random(7);
  for (const float bright : {0.2f, 0.999f, 40.f, 1000.f}) {
    const auto noisy = [&](float noise) {
      Image image = make_image(Image::Kind::kColor, kSize, kSize, {"R", "G", "B", "A"});
      for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        const float at = static_cast<float>(random()) / static_cast<float>(std::minstd_rand::max());
        image.pixels[i] = i % 4 == 3 ? 1 : srgb_to_linear(bright + bright * noise * at);
      }
      return image;
    };
    for (const float noise : {0.f, 1e-6f, 1e-4f, 1e-2f}) {
      const ImageError e = compare_images(noisy(noise), noisy(noise));
      EXPECT_GE(e.ssim, -1) << bright << " " << noise;
      EXPECT_LE(e.ssim, 1) << bright << " " << noise;
      EXPECT_LE(e.rmse, 1) << bright << " " << noise;
    }
  }
}

TEST(ImageError, PixelsThatAreNoNumbersStayWhereTheyAre) {
  Image spoilt = picture(waves);
  spoilt.at(20, 20)[0] = std::numeric_limits<float>::quiet_NaN();
  spoilt.at(30, 30)[1] = std::numeric_limits<float>::infinity();
  const ImageError e = compare_images(picture(waves), spoilt);
  EXPECT_GT(e.rmse, 0);
  EXPECT_LT(e.rmse, 0.02);
  EXPECT_GT(e.ssim, 0.9);
  EXPECT_LT(e.ssim, 1);
}

}  // namespace
}  // namespace rbvh
