#include "io/vdm_image.h"

#include <algorithm>
#include <filesystem>

#include "io/exr_header.h"
#include "io/foreign_image.h"
#include "io/image_module.h"
#include "io/input_file.h"
#include "io/max_expansion.h"
#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/text.h"

namespace rbvh {
namespace {

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw Error(ErrorKind::kInput, path, one_line(why) + "; bake the proxy again");
}

}  // namespace

std::vector<unsigned char> encode_vdm_exr(const std::string& path, const std::vector<Vec3f>& map,
                                          std::uint32_t width, std::uint32_t height) {
  const ImageSpec spec{
      .width = width,
      .height = height,
      .channels = 3,
      .channel_names = {"R", "G", "B"},
      .type = ImageSpec::Type::kFloat,
      // Left alone, DateTime and Software would tell the time and the library's version: identical work gives
      // identical bytes.
      .attributes = {
          {"compression", "zip"},
          {"DateTime", "1970:01:01 00:00:00"},
          {"Software", "rbvh"},
          {"oiio:ColorSpace", "Raw"},
          {"ImageDescription", "vector displacement: one square tile a quad, see the .vdm.json beside"},
          {"vdm:space", "object"},
          {"vdm:order", "xyz"},
          {"vdm:scale", 1.f},
          {"vdm:midlevel", 0.f}}};
  return encode_image("openexr", spec, map.data(), path);
}

std::vector<Vec3f> decode_vdm_exr(std::string_view file, const std::string& path, std::uint32_t width,
                                  std::uint32_t height) {
  const std::uint64_t texels = std::uint64_t{width} * height;
  if (texels * sizeof(Vec3f) > kMaxExpansion * file.size())
    refuse(path, "is too small (" + std::to_string(file.size()) + " bytes) for the " +
                     std::to_string(texels) + " texels that its sidecar claims");
  if (!exr_headers_fit(file)) refuse(path, "is no EXR that can be read (its header is cut)");
  std::vector<Vec3f> map;
  const auto place = [&](const ImageHeader& header) {
    if (header.width != static_cast<int>(width) || header.height != static_cast<int>(height) ||
        header.depth != 1 || header.is_deep || header.tile_width > 4096 || header.tile_height > 4096)
      refuse(path, "is not the " + std::to_string(width) + " x " + std::to_string(height) +
                       " texels that its sidecar claims");
    if (header.channels != std::vector<std::string>{"R", "G", "B"} || !header.is_float32)
      refuse(path, "does not have the channels R, G, B of 32-bit floats");
    map.resize(texels);
    return &map[0].x;
  };
  const std::string fault = image_module(path).decode("openexr", file, place, ImageSpec::Type::kFloat,
                                                      ImageModule::kAllChannels, thread_count());
  if (!fault.empty()) refuse(path, fault);
  return map;
}

namespace {

// Which channels hold the vector: R, G, B by name wherever they are, else the first three. Empty: neither one
// nor three.
std::vector<std::size_t> vector_channels(const std::vector<std::string>& names) {
  std::vector<std::size_t> found;
  for (const char* name : {"R", "G", "B"}) {
    const auto at = std::find(names.begin(), names.end(), name);
    if (at != names.end()) found.push_back(static_cast<std::size_t>(at - names.begin()));
  }
  if (found.size() == 3) return found;
  if (names.size() == 1) return {0};
  if (names.size() == 3) return {0, 1, 2};
  return {};
}

}  // namespace

VdmMap read_vdm_map(const std::string& path) {
  std::error_code code;
  if (path != "-" && !std::filesystem::exists(path, code))
    throw Error(ErrorKind::kInput, path, "there is no such displacement map");
  return decode_vdm_map(read_input(path).view(), path);
}

VdmMap decode_vdm_map(std::string_view file, const std::string& path) {
  const auto refuse_map = [&](const std::string& why) {
    throw Error(ErrorKind::kInput, path, one_line(why));
  };
  const char* format = image_format(file);
  const bool is_map =
      format != nullptr && (format == std::string_view("openexr") || format == std::string_view("png") ||
                            format == std::string_view("tiff"));
  if (!is_map) refuse_map("is no EXR, PNG or TIFF; export the displacement map as one of these");
  if (format == std::string_view("openexr") && !exr_headers_fit(file)) refuse_map("is cut in its header");
  if (is_cut_image(file)) refuse_map("is cut in one of its chunks");
  const StderrAside aside;
  VdmMap map;
  std::vector<std::size_t> channels;
  std::vector<float> values;
  std::size_t all = 0;  // channels
  const auto place = [&](const ImageHeader& header) {
    channels = vector_channels(header.channels);
    all = header.channels.size();
    if (channels.empty() || header.is_deep || header.depth > 1)
      refuse_map("has " + std::to_string(all) +
                 " channels; one (heights along the normal) or R, G and B (vectors) are wanted");
    map.width = static_cast<std::uint32_t>(header.width);
    map.height = static_cast<std::uint32_t>(header.height);
    if (header.width <= 0 || header.height <= 0 || header.width > (1 << 16) || header.height > (1 << 16) ||
        all > 64 || std::uint64_t{map.width} * map.height * all > kMaxExpansion * file.size())
      refuse_map("claims " + std::to_string(header.width) + " x " + std::to_string(header.height) +
                 " texels, more than it has bytes for");
    map.is_integer = header.is_integer;
    values.resize(std::size_t{map.width} * map.height * all);
    return values.data();
  };
  const std::string fault = image_module(path).decode(format, file, place, ImageSpec::Type::kFloat,
                                                      ImageModule::kAllChannels, thread_count());
  if (!fault.empty()) refuse_map(fault);
  const std::size_t texels = std::size_t{map.width} * map.height;
  map.channels = static_cast<std::uint32_t>(channels.size());
  map.values.resize(texels * map.channels);
  for (std::size_t i = 0; i < texels; ++i)
    for (std::size_t c = 0; c < map.channels; ++c)
      map.values[i * map.channels + c] = values[i * all + channels[c]];
  return map;
}

}  // namespace rbvh
