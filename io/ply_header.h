// The header of a PLY file: its format, its elements and their properties.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rbvh/geometry.h"
#include "rbvh/scan.h"

namespace rbvh::ply {

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

constexpr std::size_t size_of(Type type) {
  constexpr std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<int>(type)];
}
/// As headers have it.
constexpr const char* name_of(Type type) {
  constexpr const char* names[] = {"char", "uchar", "short", "ushort", "int", "uint", "float", "double"};
  return names[static_cast<int>(type)];
}
constexpr bool is_integer(Type type) { return type != Type::kFloat32 && type != Type::kFloat64; }

struct Property {
  std::string name;
  Type type = Type::kFloat32;
  bool is_list = false;
  Type count_type = Type::kUint8;
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
};

enum class Format { kAscii, kLittleEndian, kBigEndian };

/// "comment TextureFile NAME", and what rbvh says of it: "comment rbvh texture repeat clamp 1234 0123abcd..."
struct TextureComment {
  std::string name;
  TextureWrap wrap_u = TextureWrap::kRepeat, wrap_v = TextureWrap::kRepeat;
  bool times_colors = false;
  std::uint64_t bytes = 0, hash = 0;  ///< of the file; 0: not said
};

struct Header {
  Format format = Format::kAscii;
  std::vector<Element> elements;
  Vec3d shift{};
  std::string units;  ///< stated by rbvh; empty: none
  std::vector<TextureComment> textures;
  std::size_t size = 0;  ///< bytes up to the body
};

/// How a texture's wraps are called: "repeat", "mirror", "clamp".
inline constexpr std::string_view kWrapNames[] = {"repeat", "mirror", "clamp"};

/// Hostile bytes are expected. Throws Error(kInput) with the line.
Header parse_header(std::string_view bytes, const std::string& file);

}  // namespace rbvh::ply
