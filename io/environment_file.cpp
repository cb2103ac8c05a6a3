#include "io/environment_file.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "io/exr_header.h"
#include "io/image_module.h"
#include "io/input_file.h"
#include "io/max_expansion.h"
#include "pipeline/base/error.h"
#include "pipeline/base/memory_budget.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/text.h"

namespace rbvh {
namespace {

constexpr int kMostSide = 1 << 16;
constexpr std::uint32_t kFinestSide = 4096;

/// Halves a picture until its sides are within the finest that light needs.
Image reduced(Image image) {
  while (std::max(image.width, image.height) > kFinestSide) {
    Image half =
        make_image(image.kind, std::max(1u, image.width / 2), std::max(1u, image.height / 2), image.channels);
    for (std::size_t y = 0; y < half.height; ++y)
      for (std::size_t x = 0; x < half.width; ++x)
        for (std::size_t c = 0; c < 3; ++c) {
          const std::size_t right = std::min<std::size_t>(2 * x + 1, image.width - 1);
          const std::size_t below = std::min<std::size_t>(2 * y + 1, image.height - 1);
          half.at(x, y)[c] = (image.at(2 * x, 2 * y)[c] + image.at(right, 2 * y)[c] +
                              image.at(2 * x, below)[c] + image.at(right, below)[c]) /
                             4;
        }
    image = std::move(half);
  }
  return image;
}

}  // namespace

Image read_environment_map(const std::string& path, std::string* note) {
  return decode_environment_map(read_input(path).view(), path, note);
}

std::string read_light(LightWords& words, const MemoryBudget& memory) {
  if (is_light_name(words.light)) return {};
  check_read_budget(memory, words.light);
  std::string note;
  words.map = read_environment_map(words.light, &note);
  return note.empty() ? note : words.light + ": " + note;
}

Image decode_environment_map(std::string_view file, const std::string& path, std::string* note) {
  const auto refuse = [&](const std::string& why) { throw Error(ErrorKind::kInput, path, one_line(why)); };
  const bool is_exr = file.starts_with("\x76\x2f\x31\x01");
  if (!is_exr && !file.starts_with("#?")) refuse("is neither an EXR nor a Radiance HDR picture");
  if (is_exr && !exr_headers_fit(file)) refuse("is cut in its header");
  Image image;
  std::vector<float> values;
  std::size_t all = 0, channels[3] = {0, 0, 0};
  const auto place = [&](const ImageHeader& header) {
    all = header.channels.size();
    if (header.is_deep || header.depth > 1 || header.width < 1 || header.height < 1 || all < 1)
      refuse("is not a flat picture");
    if (header.width > kMostSide || header.height > kMostSide || header.tile_width > 4096 ||
        header.tile_height > 4096)
      refuse("is too large; 65536 pixels a side are the most");
    const std::uint64_t pixels =
        static_cast<std::uint64_t>(header.width) * static_cast<std::uint64_t>(header.height);
    if (pixels * all * sizeof(float) > kMaxExpansion * file.size())
      refuse("is too small for the " + std::to_string(pixels) + " pixels that it claims");
    for (std::size_t c = 0; c < 3; ++c) {
      const auto at = std::find(header.channels.begin(), header.channels.end(), std::string(1, "RGB"[c]));
      channels[c] = at != header.channels.end() ? static_cast<std::size_t>(at - header.channels.begin())
                                                : std::min(c, all - 1);
    }
    image.width = static_cast<std::uint32_t>(header.width);
    image.height = static_cast<std::uint32_t>(header.height);
    values.resize(pixels * all);
    return values.data();
  };
  const std::string fault =
      image_module(path).decode(is_exr ? "openexr" : "hdr", file, place, ImageSpec::Type::kFloat,
                                ImageModule::kAllChannels, thread_count());
  if (!fault.empty()) refuse(fault);
  image = make_image(Image::Kind::kColor, image.width, image.height, {"R", "G", "B"});
  std::uint64_t dropped = 0;
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const float value = values[i / 3 * all + channels[i % 3]];
    const bool is_light = std::isfinite(value) && value >= 0;
    dropped += !is_light;
    image.pixels[i] = is_light ? value : 0;
  }
  const std::uint32_t width = image.width, height = image.height;
  image = reduced(std::move(image));
  if (note != nullptr && dropped > 0)
    *note = counted(dropped, "value") + " below 0 or not finite taken for 0";
  if (note != nullptr && image.width < width)
    *note += (note->empty() ? "" : "; ") + std::string("averaged down from ") + std::to_string(width) +
             " x " + std::to_string(height) + " pixels to " + std::to_string(image.width) + " x " +
             std::to_string(image.height);
  return image;
}

}  // namespace rbvh
