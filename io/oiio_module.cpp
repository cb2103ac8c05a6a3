// The module rbvh_images. io/image_module.h says why it is one.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <memory>

#include "io/image_module.h"

namespace rbvh {
namespace {

OIIO::TypeDesc type_of(ImageSpec::Type type) {
  return type == ImageSpec::Type::kUint8 ? OIIO::TypeUInt8 : OIIO::TypeFloat;
}

OIIO::ImageSpec oiio_spec(const ImageSpec& from) {
  OIIO::ImageSpec spec(static_cast<int>(from.width), static_cast<int>(from.height),
                       static_cast<int>(from.channels), type_of(from.type));
  if (!from.channel_names.empty()) spec.channelnames = from.channel_names;
  if (!from.channel_names.empty()) spec.alpha_channel = -1;  // no channel multiplies another
  for (const auto& attribute : from.attributes)
    std::visit([&](const auto& value) { spec.attribute(attribute.first, value); }, attribute.second);
  return spec;
}

/// Never empty.
std::string in_words(const std::string& fault) { return fault.empty() ? "the disk may be full" : fault; }

std::string encode(const char* format, const ImageSpec& spec, const void* pixels, int threads,
                   std::vector<unsigned char>& bytes) {
  OIIO::attribute("threads", threads);
  OIIO::Filesystem::IOVecOutput memory;  // outlives the writer, which may still use it when it is destroyed
  const std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create(format);
  if (out == nullptr) return in_words(OIIO::geterror());
  out->threads(threads);
  if (!out->set_ioproxy(&memory) || !out->open(std::string("image.") + format, oiio_spec(spec)) ||
      !out->write_image(type_of(spec.type), pixels) || !out->close())
    return in_words(out->geterror());
  bytes = memory.buffer();
  return {};
}

std::string decode(const char* format, std::string_view file,
                   const std::function<void*(const ImageHeader&)>& place, ImageSpec::Type type, int channels,
                   int threads) {
  const std::unique_ptr<OIIO::ImageInput> in = OIIO::ImageInput::create(format);
  if (in == nullptr) return "cannot be read: " + OIIO::geterror();
  in->threads(threads);
  // OpenImageIO only reads through it, whatever its parameter's type.
  OIIO::Filesystem::IOMemReader reader(const_cast<char*>(file.data()), file.size());
  OIIO::ImageSpec spec, config;
  config.attribute("oiio:UnassociatedAlpha", 1);
  if (!in->set_ioproxy(&reader) || !in->open(std::string("map.") + format, spec, config))
    return "cannot be read (" + in->geterror() + ")";
  if (spec.channelnames.size() != static_cast<std::size_t>(spec.nchannels)) return "cannot be read";
  void* const texels = place({.width = spec.width,
                              .height = spec.height,
                              .depth = spec.depth,
                              .tile_width = spec.tile_width,
                              .tile_height = spec.tile_height,
                              .channels = spec.channelnames,
                              .is_deep = spec.deep,
                              .is_integer = !spec.format.is_floating_point(),
                              .is_float32 = spec.format == OIIO::TypeFloat});
  if (!in->read_image(0, 0, 0, std::min(channels, spec.nchannels), type_of(type), texels))
    return "cannot be decoded (" + in->geterror() + ")";
  return {};
}

std::string draw_text(float* pixels, std::uint32_t width, std::uint32_t height,
                      std::span<const TextSpec> texts, const std::string& font) {
  OIIO::ImageBuf picture(
      OIIO::ImageSpec(static_cast<int>(width), static_cast<int>(height), 4, OIIO::TypeFloat), pixels);
  constexpr float kInk[] = {0.02f, 0.02f, 0.025f, 1};
  for (const TextSpec& text : texts)
    if (!OIIO::ImageBufAlgo::render_text(
            picture, text.x, text.y, text.words, text.size, font, kInk,
            text.to_the_left ? OIIO::ImageBufAlgo::TextAlignX::Right : OIIO::ImageBufAlgo::TextAlignX::Left))
      return in_words(picture.geterror());
  return {};
}

std::string write_gif(const std::string& path, std::uint32_t width, std::uint32_t height,
                      std::span<const std::vector<unsigned char>> frames, float frames_per_second) {
  const std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create("gif");
  if (out == nullptr) return in_words(OIIO::geterror());
  OIIO::ImageSpec spec(static_cast<int>(width), static_cast<int>(height), 3, OIIO::TypeUInt8);
  spec.attribute("FramesPerSecond", frames_per_second);
  for (std::size_t i = 0; i < frames.size(); ++i)
    if (!out->open(path, spec, i == 0 ? OIIO::ImageOutput::Create : OIIO::ImageOutput::AppendSubimage) ||
        !out->write_image(OIIO::TypeUInt8, frames[i].data()))
      return in_words(out->geterror());
  return out->close() ? "" : in_words(out->geterror());
}

}  // namespace
}  // namespace rbvh

__attribute__((visibility("default"))) const rbvh::ImageModule* rbvh_image_module() {
  static constexpr rbvh::ImageModule kModule = {RBVH_VERSION, rbvh::encode, rbvh::decode, rbvh::draw_text,
                                                rbvh::write_gif};
  return &kModule;
}
