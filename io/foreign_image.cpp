#include "io/foreign_image.h"

#include <fcntl.h>
#include <unistd.h>

#include <cstdint>

namespace rbvh {
namespace {

using namespace std::string_view_literals;

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

/// In what follows a scan's mark, each 0xff is followed by 0 but for marks.
bool jpeg_has_end(std::string_view file) {
  const std::size_t scan = file.rfind("\xff\xda"sv);
  return scan != std::string_view::npos && file.find("\xff\xd9"sv, scan) != std::string_view::npos;
}

}  // namespace

const char* image_format(std::string_view file) {
  if (file.starts_with("\x76\x2f\x31\x01"sv)) return "openexr";
  if (file.starts_with("\x89PNG"sv)) return "png";
  if (file.starts_with("\xff\xd8\xff"sv)) return "jpeg";
  if (file.starts_with("II*\0"sv) || file.starts_with("MM\0*"sv)) return "tiff";
  if (file.starts_with("BM"sv)) return "bmp";
  if (file.starts_with("RIFF"sv) && file.size() > 12 && file.substr(8, 4) == "WEBP") return "webp";
  return nullptr;
}

const char* image_extension(std::string_view file) {
  const std::string_view format = image_format(file) != nullptr ? image_format(file) : "";
  if (format == "openexr") return ".exr";
  if (format == "jpeg") return ".jpg";
  if (format == "tiff") return ".tif";
  return format == "png" ? ".png" : format == "bmp" ? ".bmp" : format == "webp" ? ".webp" : ".image";
}

bool is_cut_image(std::string_view file) {
  const char* format = image_format(file);
  if (format == nullptr) return false;
  if (format == "png"sv) return !png_chunks_fit(file);
  return format == "jpeg"sv && !jpeg_has_end(file);
}

StderrAside::StderrAside() : kept_(::dup(STDERR_FILENO)) {
  const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (kept_ >= 0 && nowhere >= 0) ::dup2(nowhere, STDERR_FILENO);
  if (nowhere >= 0) ::close(nowhere);
}

StderrAside::~StderrAside() {
  if (kept_ < 0) return;
  ::dup2(kept_, STDERR_FILENO);
  ::close(kept_);
}

}  // namespace rbvh
