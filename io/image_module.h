// What the module rbvh_images does: all use of OpenImageIO. That brings 260 libraries, whose loading takes
// longer than most stages; so the module is loaded when the first picture, atlas or map wants it. It knows
// nothing else of rbvh.
#pragma once

#include <climits>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace rbvh {

/// An image to be written.
struct ImageSpec {
  enum class Type { kUint8, kFloat };
  std::uint32_t width = 0, height = 0;
  std::size_t channels = 0;
  std::vector<std::string> channel_names{};  ///< empty: the format's own
  Type type = Type::kUint8;
  std::vector<std::pair<std::string, std::variant<int, float, std::string>>> attributes{};
};

/// What the header of an image says. Hostile.
struct ImageHeader {
  int width = 0, height = 0, depth = 0, tile_width = 0, tile_height = 0;
  std::vector<std::string> channels;
  bool is_deep = false, is_integer = false, is_float32 = false;
};

/// A line of text: where its baseline begins or, to the left, ends.
struct TextSpec {
  std::string words;
  int x = 0, y = 0, size = 12;  ///< pixels
  bool to_the_left = false;
};

/// The functions return what went wrong, or nothing. `format`: as OpenImageIO names it, such as "jpeg".
struct ImageModule {
  const char* version;  ///< of the rbvh that it was built with

  /// The bytes of an image's file. `pixels`: width * height * channels values of the spec's type.
  std::string (*encode)(const char* format, const ImageSpec& spec, const void* pixels, int threads,
                        std::vector<unsigned char>& bytes);

  /// The first channels of the file's first image, at most `channels`. `place` sees its header first and says
  /// where they go: room for width * height * channels values of the type; or throws.
  std::string (*decode)(const char* format, std::string_view file,
                        const std::function<void*(const ImageHeader&)>& place, ImageSpec::Type type,
                        int channels, int threads);
  static constexpr int kAllChannels = INT_MAX;

  /// Dark texts with a light rim over pixels of R, G, B, A.
  std::string (*draw_text)(float* pixels, std::uint32_t width, std::uint32_t height,
                           std::span<const TextSpec> texts, const std::string& font);

  /// A GIF file that shows pictures of R, G, B one after the other, for ever.
  std::string (*write_gif)(const std::string& path, std::uint32_t width, std::uint32_t height,
                           std::span<const std::vector<unsigned char>> frames, float frames_per_second);
};

/// Loaded with its libraries by the first call. Throws Error(kFailure), naming `path`, where it cannot be.
const ImageModule& image_module(const std::string& path);

/// Its encode(): writers do not report every failed write, and OutputFile, which writes the bytes, does.
/// Throws Error(kFailure), naming `path`.
std::vector<unsigned char> encode_image(const char* format, const ImageSpec& spec, const void* pixels,
                                        const std::string& path);

}  // namespace rbvh

/// The module's one symbol.
extern "C" const rbvh::ImageModule* rbvh_image_module();
