#include "io/vdm_image.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>

#include "io/encode_image.h"
#include "io/input_file.h"
#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"

namespace rbvh {
namespace {

// What a byte of deflate can become at most (1032), and some room.
constexpr std::uint64_t kMaxExpansion = 1100;

std::string one_line(std::string why) {
  std::replace(why.begin(), why.end(), '\n', ' ');
  return why;
}

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw Error(ErrorKind::kInput, path, one_line(why) + "; bake the proxy again");
}

std::uint32_t little_number(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

/// Whether an EXR attribute is as long as OpenEXR will take it to be, which goes by the type and not by the
/// length that the file says.
bool exr_attribute_fits(std::string_view type, std::string_view data) {
  static constexpr std::pair<std::string_view, std::size_t> kLengths[] = {{"box2f", 16},
                                                                          {"box2i", 16},
                                                                          {"chromaticities", 32},
                                                                          {"compression", 1},
                                                                          {"deepImageState", 1},
                                                                          {"double", 8},
                                                                          {"envmap", 1},
                                                                          {"float", 4},
                                                                          {"int", 4},
                                                                          {"keycode", 28},
                                                                          {"lineOrder", 1},
                                                                          {"m33d", 72},
                                                                          {"m33f", 36},
                                                                          {"m44d", 128},
                                                                          {"m44f", 64},
                                                                          {"rational", 8},
                                                                          {"tiledesc", 9},
                                                                          {"timecode", 8},
                                                                          {"v2d", 16},
                                                                          {"v2f", 8},
                                                                          {"v2i", 8},
                                                                          {"v3d", 24},
                                                                          {"v3f", 12},
                                                                          {"v3i", 12}};
  for (const auto& [name, length] : kLengths)
    if (type == name) return data.size() == length;
  std::size_t at = 0;
  if (type == "chlist") {  // names, each with 16 bytes, and an empty one
    while (at < data.size() && data[at] != '\0') {
      const std::size_t end = data.find('\0', at);
      if (end == std::string_view::npos || data.size() - end < 17) return false;
      at = end + 17;
    }
    return at + 1 == data.size();
  }
  if (type == "stringvector") {
    while (data.size() - at >= 4 && little_number(data, at) <= data.size() - at - 4)
      at += 4 + little_number(data, at);
    return at == data.size();
  }
  if (type == "preview")
    return data.size() >= 8 && data.size() % 4 == 0 &&
           (data.size() - 8) / 4 == std::uint64_t{little_number(data, 0)} * little_number(data, 4);
  return type != "idmanifest";  // packed; others are read by their length
}

/// Whether the file holds all that its headers claim: OpenEXR makes room for an attribute before it reads it,
/// for up to 2 GB.
bool exr_headers_fit(std::string_view file) {
  constexpr std::size_t kVersionAt = 4, kHeaderAt = 8;
  constexpr std::uint32_t kManyParts = 0x1000;
  std::size_t at = kHeaderAt;
  const auto skip_word = [&] {
    at = file.find('\0', at);
    if (at != std::string_view::npos) ++at;
    return at < file.size();
  };
  if (file.size() <= kHeaderAt) return false;
  const bool many = (little_number(file, kVersionAt) & kManyParts) != 0;
  do {
    while (at < file.size() && file[at] != '\0') {
      if (!skip_word()) return false;
      const std::size_t type = at;
      if (!skip_word() || file.size() - at < sizeof(std::uint32_t)) return false;
      const std::uint32_t size = little_number(file, at);
      at += sizeof size;
      if (size > file.size() - at) return false;
      if (!exr_attribute_fits(file.data() + type, file.substr(at, size))) return false;
      at += size;
    }
    if (at++ >= file.size()) return false;
  } while (many && at < file.size() && file[at] != '\0');
  return true;
}

/// The same of a PNG's chunks: libpng would read on past the file's end, for up to 2 GB.
bool png_chunks_fit(std::string_view file) {
  constexpr std::size_t kSignature = 8, kAroundData = 12;  // length, name, check sum
  for (std::size_t at = kSignature; at < file.size();) {
    if (file.size() - at < kAroundData) return false;
    std::uint32_t size = 0;
    for (std::size_t i = 0; i < 4; ++i) size = size << 8 | static_cast<unsigned char>(file[at + i]);
    if (size > file.size() - at - kAroundData) return false;
    if (file.substr(at + 4, 4) == "IEND") return true;
    at += kAroundData + size;
  }
  return false;
}

/// libpng says its errors and warnings on stderr itself; ours are one line.
class StderrAside {
 public:
  StderrAside() : kept_(::dup(STDERR_FILENO)) {
    const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (kept_ >= 0 && nowhere >= 0) ::dup2(nowhere, STDERR_FILENO);
    if (nowhere >= 0) ::close(nowhere);
  }
  ~StderrAside() {
    if (kept_ < 0) return;
    ::dup2(kept_, STDERR_FILENO);
    ::close(kept_);
  }
  StderrAside(const StderrAside&) = delete;
  StderrAside& operator=(const StderrAside&) = delete;

 private:
  int kept_;
};

}  // namespace

std::vector<unsigned char> encode_vdm_exr(const std::string& path, const std::vector<Vec3f>& map,
                                          std::uint32_t width, std::uint32_t height) {
  OIIO::ImageSpec spec(static_cast<int>(width), static_cast<int>(height), 3, OIIO::TypeFloat);
  spec.channelnames = {"R", "G", "B"};
  spec.alpha_channel = -1;
  spec.attribute("compression", "zip");
  // Left alone, these would tell the time and the library's version: identical work gives identical bytes.
  spec.attribute("DateTime", "1970:01:01 00:00:00");
  spec.attribute("Software", "rbvh");
  spec.attribute("oiio:ColorSpace", "Raw");
  spec.attribute("ImageDescription", "vector displacement: one square tile a quad, see the .vdm.json beside");
  spec.attribute("vdm:space", "object");
  spec.attribute("vdm:order", "xyz");
  spec.attribute("vdm:scale", 1.f);
  spec.attribute("vdm:midlevel", 0.f);
  return encode_image("openexr", spec, OIIO::TypeFloat, map.data(), path);
}

std::vector<Vec3f> decode_vdm_exr(std::string_view file, const std::string& path, std::uint32_t width,
                                  std::uint32_t height) {
  const std::uint64_t texels = std::uint64_t{width} * height;
  if (texels * sizeof(Vec3f) > kMaxExpansion * file.size())
    refuse(path, "is too small (" + std::to_string(file.size()) + " bytes) for the " +
                     std::to_string(texels) + " texels that its sidecar claims");
  if (!exr_headers_fit(file)) refuse(path, "is no EXR that can be read (its header is cut)");
  const std::unique_ptr<OIIO::ImageInput> in = OIIO::ImageInput::create("openexr");
  if (in == nullptr) refuse(path, "cannot be read: " + OIIO::geterror());
  in->threads(thread_count());
  // OpenImageIO only reads through it, whatever its parameter's type.
  OIIO::Filesystem::IOMemReader reader(const_cast<char*>(file.data()), file.size());
  OIIO::ImageSpec spec;
  if (!in->set_ioproxy(&reader) || !in->open("map.exr", spec))
    refuse(path, "is no EXR that can be read (" + in->geterror() + ")");
  if (spec.width != static_cast<int>(width) || spec.height != static_cast<int>(height) || spec.depth != 1 ||
      spec.deep || spec.tile_width > 4096 || spec.tile_height > 4096)
    refuse(path, "is not the " + std::to_string(width) + " x " + std::to_string(height) +
                     " texels that its sidecar claims");
  if (spec.channelnames != std::vector<std::string>{"R", "G", "B"} || spec.format != OIIO::TypeFloat)
    refuse(path, "does not have the channels R, G, B of 32-bit floats");
  std::vector<Vec3f> map(texels);
  if (!in->read_image(0, 0, 0, 3, OIIO::TypeFloat, map.data()))
    refuse(path, "cannot be decoded (" + in->geterror() + ")");
  return map;
}

namespace {

// The format by the file's first bytes.
const char* format_of(std::string_view bytes) {
  using namespace std::string_view_literals;
  if (bytes.starts_with("\x76\x2f\x31\x01"sv)) return "openexr";
  if (bytes.starts_with("\x89PNG"sv)) return "png";
  if (bytes.starts_with("II*\0"sv) || bytes.starts_with("MM\0*"sv)) return "tiff";
  return nullptr;
}

// Which channels hold the vector: R, G, B by name wherever they are, else the first three. Empty: neither one
// nor three.
std::vector<int> vector_channels(const OIIO::ImageSpec& spec) {
  std::vector<int> found;
  for (const char* name : {"R", "G", "B"}) {
    const auto at = std::find(spec.channelnames.begin(), spec.channelnames.end(), name);
    if (at != spec.channelnames.end()) found.push_back(static_cast<int>(at - spec.channelnames.begin()));
  }
  if (found.size() == 3) return found;
  if (spec.nchannels == 1) return {0};
  if (spec.nchannels == 3) return {0, 1, 2};
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
  const char* format = format_of(file);
  if (format == nullptr) refuse_map("is no EXR, PNG or TIFF; export the displacement map as one of these");
  if (format == std::string_view("openexr") && !exr_headers_fit(file)) refuse_map("is cut in its header");
  if (format == std::string_view("png") && !png_chunks_fit(file)) refuse_map("is cut in one of its chunks");
  const StderrAside aside;
  const std::unique_ptr<OIIO::ImageInput> in = OIIO::ImageInput::create(format);
  if (in == nullptr) refuse_map("cannot be read: " + OIIO::geterror());
  in->threads(thread_count());
  OIIO::Filesystem::IOMemReader reader(const_cast<char*>(file.data()), file.size());
  OIIO::ImageSpec spec, config;
  config.attribute("oiio:UnassociatedAlpha", 1);
  if (!in->set_ioproxy(&reader) || !in->open(std::string("map.") + format, spec, config))
    refuse_map("cannot be read (" + in->geterror() + ")");
  const std::vector<int> channels = vector_channels(spec);
  if (channels.empty() || spec.deep || spec.depth > 1)
    refuse_map("has " + std::to_string(spec.nchannels) +
               " channels; one (heights along the normal) or R, G and B (vectors) are wanted");
  const std::uint64_t texels =
      static_cast<std::uint64_t>(spec.width) * static_cast<std::uint64_t>(spec.height);
  const auto all = static_cast<std::size_t>(spec.nchannels);
  if (spec.width <= 0 || spec.height <= 0 || spec.width > (1 << 16) || spec.height > (1 << 16) || all > 64 ||
      texels * all > kMaxExpansion * file.size())
    refuse_map("claims " + std::to_string(spec.width) + " x " + std::to_string(spec.height) +
               " texels, more than it has bytes for");
  std::vector<float> values(texels * all);
  if (!in->read_image(0, 0, 0, spec.nchannels, OIIO::TypeFloat, values.data()))
    refuse_map("cannot be decoded (" + in->geterror() + ")");
  VdmMap map;
  map.width = static_cast<std::uint32_t>(spec.width);
  map.height = static_cast<std::uint32_t>(spec.height);
  map.channels = static_cast<std::uint32_t>(channels.size());
  map.is_integer = !spec.format.is_floating_point();
  map.values.resize(texels * map.channels);
  for (std::size_t i = 0; i < texels; ++i)
    for (std::size_t c = 0; c < map.channels; ++c)
      map.values[i * map.channels + c] = values[i * all + static_cast<std::size_t>(channels[c])];
  return map;
}

}  // namespace rbvh
