#include "io/vdm_image.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>

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

[[noreturn]] void write_failed(const std::string& path, const std::string& why) {
  throw Error(ExitCode::kFailure, path,
              "cannot be written: " + (why.empty() ? "the disk may be full" : one_line(why)));
}

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw Error(ExitCode::kInput, path, one_line(why) + "; bake the proxy again");
}

}  // namespace

void write_vdm_exr(const std::string& temporary_path, const std::string& path, const std::vector<Vec3f>& map,
                   std::uint32_t width, std::uint32_t height) {
  const std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create("openexr");
  if (out == nullptr) write_failed(path, OIIO::geterror());
  out->threads(thread_count());
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
  if (!out->open(temporary_path, spec)) write_failed(path, out->geterror());
  if (!out->write_image(OIIO::TypeFloat, map.data())) write_failed(path, out->geterror());
  if (!out->close()) write_failed(path, out->geterror());
}

std::vector<Vec3f> decode_vdm_exr(std::string_view file, const std::string& path, std::uint32_t width,
                                  std::uint32_t height) {
  const std::uint64_t texels = std::uint64_t{width} * height;
  if (texels * sizeof(Vec3f) > kMaxExpansion * file.size())
    refuse(path, "is too small (" + std::to_string(file.size()) + " bytes) for the " +
                     std::to_string(texels) + " texels that its sidecar claims");
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

}  // namespace rbvh
