#include "io/ply_header.h"

#include <charconv>
#include <optional>
#include <utility>

#include "io/text_cursor.h"
#include "pipeline/base/units.h"

namespace rbvh::ply {
namespace {

constexpr std::size_t kMostTextures = 65536;

std::optional<Type> type_named(std::string_view name) {
  constexpr std::pair<std::string_view, Type> names[] = {
      {"char", Type::kInt8},       {"int8", Type::kInt8},       {"uchar", Type::kUint8},
      {"uint8", Type::kUint8},     {"short", Type::kInt16},     {"int16", Type::kInt16},
      {"ushort", Type::kUint16},   {"uint16", Type::kUint16},   {"int", Type::kInt32},
      {"int32", Type::kInt32},     {"uint", Type::kUint32},     {"uint32", Type::kUint32},
      {"float", Type::kFloat32},   {"float32", Type::kFloat32}, {"double", Type::kFloat64},
      {"float64", Type::kFloat64},
  };
  for (const auto& [known, type] : names)
    if (known == name) return type;
  return std::nullopt;
}

Type parse_type(const TextCursor& at, std::string_view name) {
  const std::optional<Type> type = type_named(name);
  if (!type) at.fail("unknown property type " + shown(name));
  return *type;
}

Property parse_property(const TextCursor& at, TextCursor& words) {
  Property property;
  std::string_view word = words.word();
  if (word == "list") {
    property.is_list = true;
    property.count_type = parse_type(at, words.word());
    if (!is_integer(property.count_type)) at.fail("a list's length must be of an integer type");
    word = words.word();
  }
  property.type = parse_type(at, word);
  property.name = words.word();
  if (property.name.empty()) at.fail("a property without a name");
  return property;
}

/// What encode_ply says of the texture before.
void parse_texture(TextCursor& words, TextureComment& texture) {
  const auto wrap = [&](TextureWrap& to) {
    const std::string_view word = words.word();
    for (std::size_t i = 0; i < std::size(kWrapNames); ++i)
      if (word == kWrapNames[i]) to = static_cast<TextureWrap>(i);
  };
  wrap(texture.wrap_u);
  wrap(texture.wrap_v);
  const auto number = [&](std::uint64_t& to, int base) {
    const std::string_view word = words.word();
    std::from_chars(word.data(), word.data() + word.size(), to, base);
  };
  number(texture.bytes, 10);
  number(texture.hash, 16);
  texture.times_colors = words.word() == "times-colors";
}

/// "comment TextureFile NAME" of any program; "comment rbvh shift X Y Z", "comment rbvh units mm" and
/// "comment rbvh texture ..." as encode_ply writes them.
void parse_comment(TextCursor& words, Header& header) {
  const std::string_view whose = words.word();
  if (whose == "TextureFile" && header.textures.size() < kMostTextures)
    header.textures.push_back({.name = std::string(trimmed({words.at, words.remaining()}))});
  if (whose != "rbvh") return;
  const std::string_view what = words.word();
  if (what == "texture" && !header.textures.empty()) return parse_texture(words, header.textures.back());
  if (what == "units") {
    const std::string_view units = words.word();
    if (unit_meters(units)) header.units = units;
  }
  if (what != "shift") return;
  Vec3d shift;
  for (int axis = 0; axis < 3; ++axis) {
    const std::string_view word = words.word();
    if (!read_number(word.data(), word.data() + word.size(), shift[axis])) return;
  }
  if (is_finite(shift)) header.shift = shift;
}

}  // namespace

Header parse_header(std::string_view bytes, const std::string& file) {
  Header header;
  TextCursor lines(bytes, file);
  std::string_view line;
  if (!lines.next_line(line) || TextCursor(line, file).word() != "ply")
    throw Error(ErrorKind::kInput, file, "is no PLY file: it does not begin with the line 'ply'");
  bool has_format = false;
  for (;;) {
    const TextCursor at = lines;
    if (!lines.next_line(line)) lines.fail("the file is cut inside its header (no 'end_header')");
    TextCursor words(line, file);
    const std::string_view key = words.word();
    if (key == "end_header") break;
    if (key == "format") {
      const std::string_view format = words.word();
      has_format = true;
      if (format == "ascii") {
        header.format = Format::kAscii;
      } else if (format == "binary_little_endian") {
        header.format = Format::kLittleEndian;
      } else if (format == "binary_big_endian") {
        header.format = Format::kBigEndian;
      } else {
        at.fail("unknown format " + shown(format));
      }
    } else if (key == "element") {
      Element element;
      element.name = words.word();
      const std::string_view count = words.word();
      const auto [end, error] = std::from_chars(count.data(), count.data() + count.size(), element.count);
      if (element.name.empty() || error != std::errc() || end != count.data() + count.size())
        at.fail("'element' needs a name and a count");
      header.elements.push_back(std::move(element));
    } else if (key == "property") {
      if (header.elements.empty()) at.fail("'property' before any 'element'");
      header.elements.back().properties.push_back(parse_property(at, words));
    } else if (key == "comment") {
      parse_comment(words, header);
    } else if (!key.empty() && key != "obj_info") {
      if (lines.at_end()) lines.fail("the file is cut inside its header");
      at.fail("unknown header line " + shown(line));
    }
  }
  if (!has_format) lines.fail("the header has no 'format' line");
  header.size = lines.byte();
  return header;
}

}  // namespace rbvh::ply
