#include "io/ply.h"

#include <bit>
#include <cstring>
#include <optional>
#include <utility>

#include "io/colors.h"
#include "io/text_cursor.h"

namespace rbvh {
namespace {

static_assert(std::endian::native == std::endian::little, "the binary paths assume a little-endian host");

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

constexpr std::size_t size_of(Type type) {
  constexpr std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<int>(type)];
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

struct Header {
  Format format = Format::kAscii;
  std::vector<Element> elements;
  Vec3d shift{};
  std::size_t size = 0;  ///< bytes up to the body
};

// --- header
// -------------------------------------------------------------------------------------------------------

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

/// "comment rbvh shift X Y Z", as encode_ply writes it.
void parse_comment(TextCursor& words, Header& header) {
  if (words.word() != "rbvh" || words.word() != "shift") return;
  Vec3d shift;
  for (int axis = 0; axis < 3; ++axis) {
    const std::string_view word = words.word();
    if (!read_number(word.data(), word.data() + word.size(), shift[axis])) return;
  }
  if (is_finite(shift)) header.shift = shift;
}

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

// --- body: where values come from
// ---------------------------------------------------------------------------------

/// What both sources share: where in the elements they are, for messages.
struct Place {
  const Element* element = nullptr;
  std::uint64_t index = 0;

  std::string words() const {
    return element->name + " " + std::to_string(index) + " of " + std::to_string(element->count);
  }
};

class AsciiSource {
 public:
  Place place;
  AsciiSource(std::string_view bytes, std::size_t from, const std::string& file) : in_(bytes, file) {
    in_.at += from;
  }

  /// A value takes a digit and a space at least; the last one may lack the space.
  std::uint64_t least_bytes(const Property&) const { return 2; }
  std::uint64_t available() const { return in_.remaining() + 1; }

  double number(Type) {
    in_.skip_spaces();
    double value = 0;
    const char* end = read_number(in_.at, in_.end, value);
    if (!end || (end < in_.end && !is_space(*end))) bad_word("a number");
    in_.at = end;
    return value;
  }
  std::int64_t integer(Type) {
    in_.skip_spaces();
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(in_.at, in_.end, value);
    if (error != std::errc() || (end < in_.end && !is_space(*end))) bad_word("an integer");
    in_.at = end;
    return value;
  }
  void skip(Type type, std::uint64_t count) {
    for (std::uint64_t i = 0; i < count; ++i) number(type);
  }
  void check_end(const std::vector<Element>&, std::vector<std::string>&) {
    in_.skip_spaces();
    if (!in_.at_end()) in_.fail("there is more data than the header's counts say; one of them is wrong");
  }
  [[noreturn]] void fail(const std::string& what) const { in_.fail(what + " in " + place.words()); }
  [[noreturn]] void fail_here(const std::string& what) const { in_.fail(what); }

 private:
  [[noreturn]] void bad_word(const char* wanted) {
    const TextCursor at = in_;
    const std::string_view word = in_.word();
    if (word.empty()) at.fail("the file is cut in " + place.words() + "; copy it again");
    at.fail(shown(word) + " is not " + wanted + " in " + place.words());
  }
  TextCursor in_;
};

template <bool kSwap>
class BinarySource {
 public:
  Place place;
  BinarySource(std::string_view bytes, std::size_t from, const std::string& file)
      : begin_(bytes.data()), at_(begin_ + from), end_(begin_ + bytes.size()), file_(file) {}

  std::uint64_t least_bytes(const Property& property) const {
    return size_of(property.is_list ? property.count_type : property.type);
  }
  std::uint64_t available() const { return static_cast<std::uint64_t>(end_ - at_); }

  double number(Type type) {
    switch (type) {
      case Type::kInt8:
        return take<std::int8_t>();
      case Type::kUint8:
        return take<std::uint8_t>();
      case Type::kInt16:
        return take<std::int16_t>();
      case Type::kUint16:
        return take<std::uint16_t>();
      case Type::kInt32:
        return take<std::int32_t>();
      case Type::kUint32:
        return take<std::uint32_t>();
      case Type::kFloat32:
        return std::bit_cast<float>(take<std::uint32_t>());
      case Type::kFloat64:
        return std::bit_cast<double>(take<std::uint64_t>());
    }
    return 0;
  }
  /// Of an integer type: none is so wide that a double would round it.
  std::int64_t integer(Type type) {
    RBVH_CHECK(is_integer(type));
    return static_cast<std::int64_t>(number(type));
  }
  void skip(Type type, std::uint64_t count) {
    need(count > available() ? available() + 1 : count * size_of(type));
    at_ += count * size_of(type);
  }
  /// Fewer bytes than one more entry may be padding; more are a wrong count.
  void check_end(const std::vector<Element>& elements, std::vector<std::string>& notes) {
    if (available() == 0) return;
    std::uint64_t entry = 0;
    if (!elements.empty())
      for (const Property& property : elements.back().properties) entry += least_bytes(property);
    const std::string left = std::to_string(available()) + " bytes follow the last element";
    if (available() >= std::max<std::uint64_t>(entry, 4))
      throw Error(ErrorKind::kInput, file_,
                  "byte " + std::to_string(at_ - begin_) + ": " + left + "; a count in the header is wrong");
    notes.push_back(left + " and were ignored");
  }
  [[noreturn]] void fail(const std::string& what) const { fail_here(what + " in " + place.words()); }
  [[noreturn]] void fail_here(const std::string& what) const {
    throw Error(ErrorKind::kInput, file_, "byte " + std::to_string(at_ - begin_) + ": " + what);
  }

 private:
  void need(std::uint64_t bytes) const {
    if (available() < bytes)
      throw Error(ErrorKind::kInput, file_,
                  "byte " + std::to_string(end_ - begin_) + ": the file is cut in " + place.words() +
                      "; copy it again");
  }
  template <class T>
  T take() {
    need(sizeof(T));
    unsigned char raw[sizeof(T)];
    for (std::size_t i = 0; i < sizeof(T); ++i)
      raw[i] = static_cast<unsigned char>(at_[kSwap ? sizeof(T) - 1 - i : i]);
    T value;
    std::memcpy(&value, raw, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  const char *begin_, *at_, *end_;
  const std::string& file_;
};

// --- body: where values go
// ----------------------------------------------------------------------------------------

std::int32_t to_int32(double value) {
  if (!(value > -2147483648.0)) return value <= -2147483648.0 ? std::numeric_limits<std::int32_t>::min() : 0;
  return value < 2147483647.0 ? static_cast<std::int32_t>(value) : std::numeric_limits<std::int32_t>::max();
}

/// Holds a count against the bytes left, so that nothing is allocated for what cannot be there.
template <class Source>
void check_fits(Source& in, const Element& element) {
  std::uint64_t entry = 0;
  for (const Property& property : element.properties) entry += in.least_bytes(property);
  if (entry > 0 && element.count > in.available() / entry)
    in.fail_here("the header promises " + std::to_string(element.count) + " of element '" + element.name +
                 "', but there are bytes for " + std::to_string(in.available() / entry) +
                 " at most: the file is cut or its counts are wrong");
}

template <class Source>
void skip_property(Source& in, const Property& property) {
  std::uint64_t count = 1;
  if (property.is_list) {
    const std::int64_t length = in.integer(property.count_type);
    if (length < 0) in.fail("a list of negative length");
    count = static_cast<std::uint64_t>(length);
  }
  in.skip(property.type, count);
}

/// Where one scalar vertex property goes: into an array of doubles, floats, bytes or ints with a stride.
struct Target {
  enum Kind { kSkip, kDouble, kFloat, kByte, kInt } kind = kSkip;
  char* to = nullptr;
  std::size_t stride = 0;
};

template <class Source>
void read_vertices(Source& in, const Element& element, RawScan& scan) {
  const auto count = static_cast<std::size_t>(element.count);
  const auto& properties = element.properties;
  const auto find = [&](std::initializer_list<std::string_view> names) -> int {
    for (const std::string_view name : names)
      for (std::size_t i = 0; i < properties.size(); ++i)
        if (!properties[i].is_list && properties[i].name == name) return static_cast<int>(i);
    return -1;
  };
  std::vector<Target> targets(properties.size());
  const auto aim = [&](int property, Target::Kind kind, void* to, std::size_t stride) {
    if (property >= 0) targets[static_cast<std::size_t>(property)] = {kind, static_cast<char*>(to), stride};
  };

  const int x = find({"x"}), y = find({"y"}), z = find({"z"});
  if (x < 0 || y < 0 || z < 0) in.fail_here("the vertices have no x, y and z");
  check_fits(in, element);
  scan.positions.resize(count);
  aim(x, Target::kDouble, &scan.positions.data()->x, sizeof(Vec3d));
  aim(y, Target::kDouble, &scan.positions.data()->y, sizeof(Vec3d));
  aim(z, Target::kDouble, &scan.positions.data()->z, sizeof(Vec3d));

  const int nx = find({"nx", "normal_x"}), ny = find({"ny", "normal_y"}), nz = find({"nz", "normal_z"});
  if (nx >= 0 && ny >= 0 && nz >= 0) {
    scan.normals.resize(count);
    aim(nx, Target::kFloat, &scan.normals.data()->x, sizeof(Vec3f));
    aim(ny, Target::kFloat, &scan.normals.data()->y, sizeof(Vec3f));
    aim(nz, Target::kFloat, &scan.normals.data()->z, sizeof(Vec3f));
  }
  if (const int radius = find({"radius"}); radius >= 0) {
    scan.radii.resize(count);
    aim(radius, Target::kFloat, scan.radii.data(), sizeof(float));
  }
  if (const int id = find({"object_id"}); id >= 0) {
    scan.object_ids.resize(count);
    aim(id, Target::kInt, scan.object_ids.data(), sizeof(std::int32_t));
  }
  const int rgb[3] = {find({"red", "r", "diffuse_red"}), find({"green", "g", "diffuse_green"}),
                      find({"blue", "b", "diffuse_blue"})};
  std::vector<Vec3f> wide_colors;
  if (rgb[0] >= 0 && rgb[1] >= 0 && rgb[2] >= 0) {
    bool bytes = true;
    for (const int channel : rgb) bytes &= properties[static_cast<std::size_t>(channel)].type == Type::kUint8;
    scan.colors.resize(bytes ? count : 0);
    wide_colors.resize(bytes ? 0 : count);
    for (std::size_t c = 0; c < 3; ++c)
      if (bytes) {
        aim(rgb[c], Target::kByte, scan.colors.empty() ? nullptr : scan.colors.data()->data() + c,
            sizeof(Color8));
      } else {
        aim(rgb[c], Target::kFloat, wide_colors.data() + 0, sizeof(Vec3f));
        targets[static_cast<std::size_t>(rgb[c])].to += c * sizeof(float);
      }
  }
  std::size_t scalars = 0;
  for (std::size_t i = 0; i < properties.size(); ++i)
    scalars += targets[i].kind == Target::kSkip && !properties[i].is_list;
  scan.properties.reserve(scalars);
  for (std::size_t i = 0; i < properties.size(); ++i) {
    if (targets[i].kind != Target::kSkip) continue;
    if (properties[i].is_list) {
      scan.notes.push_back("the list property '" + properties[i].name + "' of the vertices is not kept");
      continue;
    }
    scan.properties.push_back({properties[i].name, std::vector<float>(count)});
    aim(static_cast<int>(i), Target::kFloat, scan.properties.back().values.data(), sizeof(float));
  }

  for (in.place.index = 0; in.place.index < count; ++in.place.index)
    for (std::size_t i = 0; i < targets.size(); ++i) {
      Target& target = targets[i];
      switch (target.kind) {
        case Target::kSkip:
          skip_property(in, properties[i]);
          continue;
        case Target::kDouble:
          *reinterpret_cast<double*>(target.to) = in.number(properties[i].type);
          break;
        case Target::kFloat:
          *reinterpret_cast<float*>(target.to) = static_cast<float>(in.number(properties[i].type));
          break;
        case Target::kByte:
          *reinterpret_cast<std::uint8_t*>(target.to) = to_color_byte(in.number(properties[i].type));
          break;
        case Target::kInt:
          *reinterpret_cast<std::int32_t*>(target.to) = to_int32(in.number(properties[i].type));
          break;
      }
      target.to += target.stride;
    }
  if (!wide_colors.empty()) scan.colors = colors_from_floats(wide_colors);
}

/// The vertex list of a face or strip element, or -1.
int find_index_list(const Element& element) {
  int found = -1;
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const Property& property = element.properties[i];
    if (!property.is_list || !is_integer(property.type)) continue;
    if (property.name == "vertex_indices" || property.name == "vertex_index") return static_cast<int>(i);
    if (found < 0) found = static_cast<int>(i);
  }
  return found;
}

void note_dropped(const Element& element, int kept, int also_kept, RawScan& scan) {
  for (int i = 0; i < static_cast<int>(element.properties.size()); ++i)
    if (i != kept && i != also_kept)
      scan.notes.push_back("the property '" + element.properties[static_cast<std::size_t>(i)].name +
                           "' of element '" + element.name + "' is not kept");
}

/// Faces (fans) and, with `strips`, triangle strips separated by -1.
template <class Source>
void read_faces(Source& in, const Element& element, std::uint64_t vertex_count, bool strips, RawScan& scan) {
  const int list = find_index_list(element);
  if (list < 0) {
    if (element.count > 0) in.fail_here("the faces have no list of vertex indices");
    return;
  }
  int id_property = -1;
  for (std::size_t i = 0; i < element.properties.size(); ++i)
    if (element.properties[i].name == "object_id" && !element.properties[i].is_list)
      id_property = static_cast<int>(i);
  check_fits(in, element);
  note_dropped(element, list, id_property, scan);
  scan.triangles.reserve(scan.triangles.size() + static_cast<std::size_t>(element.count));

  const auto read_index = [&](Type type) {
    const std::int64_t index = in.integer(type);
    if (index < (strips ? -1 : 0) || index >= static_cast<std::int64_t>(vertex_count))
      in.fail("the vertex index " + std::to_string(index) + " is out of range (there are " +
              std::to_string(vertex_count) + " vertices)");
    return static_cast<std::uint32_t>(index);
  };
  std::uint64_t too_short = 0;
  const auto read_list = [&](const Property& property) {
    const std::int64_t length = in.integer(property.count_type);
    if (length < 0) in.fail("a list of negative length");
    too_short += length < 3;
    // The last three indices of a strip, or the first, the last and the newest of a fan.
    std::uint32_t a = 0, b = 0;
    std::int64_t run = 0;
    for (std::int64_t i = 0; i < length; ++i) {
      const std::uint32_t c = read_index(property.type);
      if (strips && c == UINT32_MAX) {
        run = 0;
        continue;
      }
      if (run >= 2) scan.triangles.push_back(strips && run % 2 == 1 ? Triangle{b, a, c} : Triangle{a, b, c});
      if (run == 0 || (strips && run >= 2)) a = run == 0 ? c : b;
      if (run > 0) b = c;
      ++run;
    }
  };
  for (in.place.index = 0; in.place.index < element.count; ++in.place.index) {
    const std::size_t before = scan.triangles.size();
    std::int32_t id = 0;
    for (int i = 0; i < static_cast<int>(element.properties.size()); ++i) {
      const Property& property = element.properties[static_cast<std::size_t>(i)];
      if (i == list) {
        read_list(property);
      } else if (i == id_property) {
        id = to_int32(in.number(property.type));
      } else {
        skip_property(in, property);
      }
    }
    if (id_property >= 0) {
      scan.object_ids.resize(before);
      scan.object_ids.resize(scan.triangles.size(), id);
    }
  }
  if (too_short > 0)
    scan.notes.push_back(std::to_string(too_short) + " faces with fewer than three corners were left out");
}

/// PCL writes where the sensor stood as an element 'camera' with one entry.
template <class Source>
void read_camera(Source& in, const Element& element, RawScan& scan) {
  check_fits(in, element);
  int found = 0;
  Vec3d position;
  for (in.place.index = 0; in.place.index < element.count; ++in.place.index)
    for (const Property& property : element.properties) {
      const std::string_view name = property.name;
      const int axis = name == "view_px" ? 0 : name == "view_py" ? 1 : name == "view_pz" ? 2 : -1;
      if (axis < 0 || property.is_list || in.place.index > 0) {
        skip_property(in, property);
      } else {
        position[axis] = in.number(property.type);
        ++found;
      }
    }
  if (found == 3 && is_finite(position))
    scan.viewpoints = {{.position = position, .is_default = position == Vec3d{}}};
}

template <class Source>
void skip_element(Source& in, const Element& element, RawScan& scan) {
  if (element.count == 0) return;
  scan.notes.push_back("the element '" + element.name + "' (" + std::to_string(element.count) +
                       ") is not kept");
  check_fits(in, element);
  if (element.properties.empty()) return;
  for (in.place.index = 0; in.place.index < element.count; ++in.place.index)
    for (const Property& property : element.properties) skip_property(in, property);
}

template <class Source>
RawScan read_body(Source in, const Header& header, const std::string& file) {
  RawScan scan;
  scan.shift = header.shift;
  std::uint64_t vertex_count = 0;
  bool has_vertices = false;
  for (const Element& element : header.elements) {
    if (element.name != "vertex") continue;
    if (has_vertices) throw Error(ErrorKind::kInput, file, "has two elements 'vertex'");
    has_vertices = true;
    vertex_count = element.count;
  }
  if (vertex_count == 0) throw Error(ErrorKind::kInput, file, "has no vertices");
  if (vertex_count >= UINT32_MAX)
    throw Error(ErrorKind::kInput, file,
                "claims " + std::to_string(vertex_count) + " vertices; 4294967294 is the limit");

  std::vector<std::int32_t> vertex_ids;
  for (const Element& element : header.elements) {
    in.place = {&element, 0};
    if (element.name == "vertex") {
      std::vector<std::int32_t> face_ids = std::move(scan.object_ids);
      scan.object_ids.clear();
      read_vertices(in, element, scan);
      vertex_ids = std::exchange(scan.object_ids, std::move(face_ids));
    } else if (element.name == "face" || element.name == "tristrips") {
      read_faces(in, element, vertex_count, element.name == "tristrips", scan);
    } else if (element.name == "camera") {
      read_camera(in, element, scan);
    } else {
      skip_element(in, element, scan);
    }
  }
  in.check_end(header.elements, scan.notes);

  // Object ids and radii belong to the vertices of a cloud alone; on a mesh they are two properties among
  // others.
  if (scan.triangles.empty()) {
    scan.object_ids = std::move(vertex_ids);
    return scan;
  }
  if (!scan.object_ids.empty()) scan.object_ids.resize(scan.triangles.size());
  if (!vertex_ids.empty()) scan.properties.push_back({"object_id", {vertex_ids.begin(), vertex_ids.end()}});
  if (!scan.radii.empty()) scan.properties.push_back({"radius", std::exchange(scan.radii, {})});
  return scan;
}

}  // namespace

bool is_ply(std::string_view bytes) {
  return bytes.size() > 3 && bytes.substr(0, 3) == "ply" && is_space(bytes[3]);
}

RawScan read_ply(std::string_view bytes, const std::string& file) {
  const Header header = parse_header(bytes, file);
  switch (header.format) {
    case Format::kAscii:
      return read_body(AsciiSource(bytes, header.size, file), header, file);
    case Format::kLittleEndian:
      return read_body(BinarySource<false>(bytes, header.size, file), header, file);
    case Format::kBigEndian:
      return read_body(BinarySource<true>(bytes, header.size, file), header, file);
  }
  RBVH_CHECK(false);
}

}  // namespace rbvh
