#include "io/image.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <span>

#include "io/image_module.h"
#include "io/output_file.h"
#include "io/png.h"
#include "pipeline/base/error.h"
#include "rbvh/image_bytes.h"

namespace rbvh {
namespace {

constexpr int kJpegQuality = 92;

bool is_stream(const std::string& path) {
  if (path == "-") return true;
  std::error_code code;
  const std::filesystem::file_status status = std::filesystem::status(path, code);
  return std::filesystem::is_character_file(status) || std::filesystem::is_fifo(status) ||
         std::filesystem::is_socket(status);
}

}  // namespace

ImageFormat image_format(const std::string& path, Image::Kind kind) {
  const bool is_data = kind == Image::Kind::kData;
  if (is_stream(path)) return is_data ? ImageFormat::kExr : ImageFormat::kPng;
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (extension == ".exr") return ImageFormat::kExr;
  if (extension != ".png" && extension != ".jpg" && extension != ".jpeg")
    throw Error(ErrorKind::kUsage, path,
                "images are written as .png, .jpg, .jpeg or .exr; choose one of these");
  if (is_data)
    throw Error(ErrorKind::kUsage, path,
                "only .exr holds these values unchanged; give a name that ends in .exr");
  return extension == ".png" ? ImageFormat::kPng : ImageFormat::kJpeg;
}

std::vector<std::byte> encode_image_png(const Image& image) {
  const std::size_t channels = image.channels.size();
  return encode_png(image.width, image.height, channels, image_bytes(image, channels),
                    image.kind == Image::Kind::kColor);
}

void write_image(const std::string& path, const Image& image, bool overwrite) {
  const ImageFormat format = image_format(path, image.kind);
  OutputFile file(path, overwrite);
  const bool is_color = image.kind == Image::Kind::kColor;
  if (format == ImageFormat::kPng) {
    file.write(encode_image_png(image));
    return file.commit();
  }
  ImageSpec spec;
  spec.width = image.width;
  spec.height = image.height;
  spec.channels = image.channels.size();
  // Or OpenImageIO puts the clock's, and no two files are equal.
  spec.attributes = {{"DateTime", "1970:01:01 00:00:00"}};
  std::vector<unsigned char> bytes;
  if (format == ImageFormat::kExr) {
    spec.type = ImageSpec::Type::kFloat;
    spec.channel_names = image.channels;
    spec.attributes.push_back({"compression", "zip"});
    bytes = encode_image("openexr", spec, image.pixels.data(), path);
  } else {
    if (spec.channels == 4) spec.channels = 3;
    if (is_color) spec.attributes.push_back({"oiio:ColorSpace", "sRGB"});
    spec.attributes.push_back({"CompressionQuality", kJpegQuality});
    bytes = encode_image("jpeg", spec, image_bytes(image, spec.channels).data(), path);
  }
  file.write(std::as_bytes(std::span(bytes)));
  file.commit();
}

void write_movie(const std::string& path, std::span<const Image> frames, bool overwrite) {
  constexpr float kFramesPerSecond = 12;
  OutputFile file(path, overwrite);
  std::vector<std::vector<unsigned char>> bytes;
  for (const Image& frame : frames) bytes.push_back(image_bytes(frame, 3));
  const std::string fault = image_module(path).write_gif(file.temporary_path(), frames[0].width,
                                                         frames[0].height, bytes, kFramesPerSecond);
  if (!fault.empty()) throw Error(ErrorKind::kFailure, path, "the film cannot be written: " + fault);
  file.commit();
}

}  // namespace rbvh
