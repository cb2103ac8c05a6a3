#include "io/exr_header.h"

#include <cstdint>
#include <cstring>
#include <utility>

namespace rbvh {
namespace {

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

}  // namespace

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

}  // namespace rbvh
