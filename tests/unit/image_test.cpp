#include "io/image.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <thread>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

class ImageFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("image_test_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  static std::string bytes(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  fs::path folder_;
};

Image color_image() {
  Image image = make_image(Image::Kind::kColor, 3, 2, {"R", "G", "B", "A"});
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t c = 0; c < 4; ++c) image.pixels[i * 4 + c] = c == 3 ? 1 : 0.214f;  // 0.5 in sRGB
  image.at(2, 1)[3] = 0;
  for (int c = 0; c < 3; ++c) image.at(2, 1)[c] = 0;
  return image;
}

std::optional<ErrorKind> code_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    return error.kind();
  }
  return std::nullopt;
}

TEST_F(ImageFile, PngIsSrgbWithStraightAlpha) {
  write_image(path("a.png"), color_image(), false);
  const auto in = OIIO::ImageInput::open(path("a.png"));
  ASSERT_TRUE(in);
  ASSERT_EQ(in->spec().nchannels, 4);
  std::vector<std::uint8_t> pixels(24);
  ASSERT_TRUE(in->read_image(0, 0, 0, -1, OIIO::TypeDesc::UINT8, pixels.data()));
  EXPECT_NEAR(pixels[0], 128, 1);
  EXPECT_EQ(pixels[3], 255);
  EXPECT_EQ(pixels[23], 0);
}

TEST_F(ImageFile, JpegHasABackgroundInsteadOfAlpha) {
  Image image = make_image(Image::Kind::kColor, 16, 16, {"R", "G", "B", "A"});
  write_image(path("a.jpg"), image, false);
  const auto in = OIIO::ImageInput::open(path("a.jpg"));
  ASSERT_TRUE(in);
  ASSERT_EQ(in->spec().nchannels, 3);
  std::vector<std::uint8_t> pixels(16 * 16 * 3);
  ASSERT_TRUE(in->read_image(0, 0, 0, -1, OIIO::TypeDesc::UINT8, pixels.data()));
  EXPECT_GT(pixels[0], 200);
}

TEST_F(ImageFile, ExrKeepsFloatsInfinityAndChannelNames) {
  Image image = make_image(Image::Kind::kData, 2, 1, {"Z"});
  image.pixels = {1.2345678f, std::numeric_limits<float>::infinity()};
  write_image(path("a.exr"), image, false);
  const auto in = OIIO::ImageInput::open(path("a.exr"));
  ASSERT_TRUE(in);
  EXPECT_EQ(in->spec().channelnames, std::vector<std::string>{"Z"});
  EXPECT_EQ(in->spec().format, OIIO::TypeDesc::FLOAT);
  std::vector<float> pixels(2);
  ASSERT_TRUE(in->read_image(0, 0, 0, -1, OIIO::TypeDesc::FLOAT, pixels.data()));
  EXPECT_EQ(pixels, image.pixels);
}

TEST_F(ImageFile, EqualPicturesGiveEqualBytes) {
  for (const std::string extension : {".png", ".jpg", ".exr"}) {
    write_image(path("a" + extension), color_image(), false);
    std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // file times have seconds
    write_image(path("b" + extension), color_image(), false);
    EXPECT_EQ(bytes(path("a" + extension)), bytes(path("b" + extension))) << extension;
  }
}

TEST_F(ImageFile, RefusesUnknownFormatsAndDataInEightBits) {
  EXPECT_EQ(code_of([&] { write_image(path("a.bmp"), color_image(), false); }), ErrorKind::kUsage);
  EXPECT_EQ(code_of([&] { write_image(path("a"), color_image(), false); }), ErrorKind::kUsage);
  const Image depth = make_image(Image::Kind::kData, 2, 2, {"Z"});
  EXPECT_EQ(code_of([&] { write_image(path("a.png"), depth, false); }), ErrorKind::kUsage);
  EXPECT_TRUE(fs::is_empty(folder_));
  EXPECT_EQ(image_format("-", Image::Kind::kColor), ImageFormat::kPng);
  EXPECT_EQ(image_format("/dev/null", Image::Kind::kData), ImageFormat::kExr);
  EXPECT_EQ(image_format("A.JPeG", Image::Kind::kColor), ImageFormat::kJpeg);
}

TEST_F(ImageFile, FailsWholeOrNotAtAll) {
  EXPECT_EQ(code_of([&] { write_image("/dev/full/x.png", color_image(), false); }), ErrorKind::kFailure);
  write_image(path("a.png"), color_image(), false);
  EXPECT_EQ(code_of([&] { write_image(path("a.png"), color_image(), false); }), ErrorKind::kFailure);
  EXPECT_EQ(code_of([&] { write_image(path("a.png"), color_image(), true); }), std::nullopt);
}

// No writer of OpenImageIO reports every failed write: PNG's none, and JPEG's ends the process.
TEST_F(ImageFile, AFileSizeLimitAnywhereIsAnErrorAndTheOldPictureStays) {
  Image image = make_image(Image::Kind::kColor, 90, 60, {"R", "G", "B", "A"});
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<float>(i * 2654435761u % 1000) / 1000;
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit old{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &old), 0);
  for (const std::string extension : {".png", ".jpg", ".exr"}) {
    write_image(path("whole" + extension), image, false);
    const std::size_t size = bytes(path("whole" + extension)).size();
    const std::string replaced = path("replaced" + extension), fresh = path("new" + extension);
    std::ofstream(replaced) << "old";
    for (const std::size_t most :
         {std::size_t{0}, std::size_t{1}, std::size_t{300}, size / 4, size / 2, size - 1}) {
      const rlimit limit{most, old.rlim_max};
      ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
      const auto of_new = code_of([&] { write_image(fresh, image, false); });
      const auto of_old = code_of([&] { write_image(replaced, image, true); });
      ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &old), 0);
      EXPECT_EQ(of_new, ErrorKind::kFailure) << extension << " of " << size << " at " << most;
      EXPECT_EQ(of_old, ErrorKind::kFailure) << extension << " of " << size << " at " << most;
      EXPECT_FALSE(fs::exists(fresh)) << most;
      EXPECT_EQ(bytes(replaced), "old") << most;
    }
    const rlimit just_enough{size, old.rlim_max};
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &just_enough), 0);
    EXPECT_EQ(code_of([&] { write_image(replaced, image, true); }), std::nullopt) << extension;
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &old), 0);
    EXPECT_EQ(bytes(replaced), bytes(path("whole" + extension)));
    EXPECT_EQ(code_of([&] { write_image("/dev/full", image, false); }), ErrorKind::kFailure);
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 6);
}

TEST(Srgb, BothWaysAgree) {
  for (const float v : {0.f, 0.001f, 0.0031308f, 0.04f, 0.5f, 1.f})
    EXPECT_NEAR(srgb_to_linear(linear_to_srgb(v)), v, 1e-6);
  EXPECT_NEAR(linear_to_srgb(0.214041f), 0.5f, 1e-4);
}

}  // namespace
}  // namespace rbvh
