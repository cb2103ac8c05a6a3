#include "io/pcd.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <memory>
#include <optional>
#include <utility>

#include "io/colors.h"
#include "io/lzf.h"
#include "io/property_names.h"
#include "io/text_cursor.h"

namespace rbvh {
namespace {

struct Field {
  std::string name;
  std::size_t size = 4;
  char type = 'F';
  std::size_t count = 1;
  std::size_t offset = 0;  ///< in a point, bytes
};

constexpr std::size_t kLargestPoint = std::size_t{1} << 20;

struct Header {
  std::vector<Field> fields;
  std::uint64_t width = 0, height = 1, points = 0;
  bool has_width = false, has_points = false;
  std::size_t point_size = 0, point_values = 0;
  std::string data;
  std::vector<Viewpoint> viewpoints;
};

std::string upper(std::string_view text) {
  std::string result(text);
  for (char& c : result)
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  return result;
}

std::uint64_t parse_count(const TextCursor& at, std::string_view word) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (word.empty() || error != std::errc() || end != word.data() + word.size())
    at.fail(shown(word) + " is not a count");
  return value;
}

/// VIEWPOINT tx ty tz qw qx qy qz
void parse_viewpoint(TextCursor& words, Header& header) {
  double values[7] = {0, 0, 0, 1, 0, 0, 0};
  int count = 0;
  for (double& value : values) {
    const std::string_view word = words.word();
    if (word.empty() || !read_number(word.data(), word.data() + word.size(), value)) break;
    ++count;
  }
  const Vec3d position{values[0], values[1], values[2]};
  if (count < 3 || !is_finite(position)) return;
  const bool upright = values[3] == 1 && values[4] == 0 && values[5] == 0 && values[6] == 0;
  header.viewpoints = {{.position = position, .is_default = position == Vec3d{} && upright}};
}

Header parse_header(TextCursor& in) {
  Header header;
  std::string_view line;
  while (header.data.empty()) {
    const TextCursor at = in;
    if (!in.next_line(line)) in.fail("the file is cut inside its header (no 'DATA' line)");
    TextCursor words(line, *in.file);
    const std::string key = upper(words.word());
    if (key.empty() || key[0] == '#' || key == "VERSION") continue;
    auto& fields = header.fields;
    const auto each_field = [&](auto&& set) {
      for (Field& field : fields) {
        const std::string_view word = words.word();
        if (word.empty()) at.fail("fewer entries than FIELDS has");
        set(field, word);
      }
      if (!words.word().empty()) at.fail("more entries than FIELDS has");
    };
    if (key == "FIELDS" || key == "COLUMNS") {
      for (std::string_view word; !(word = words.word()).empty();)
        fields.push_back({.name = std::string(word)});
    } else if (key == "SIZE") {
      each_field([&](Field& field, std::string_view word) { field.size = parse_count(at, word); });
    } else if (key == "TYPE") {
      each_field([&](Field& field, std::string_view word) { field.type = upper(word.substr(0, 1))[0]; });
    } else if (key == "COUNT") {
      each_field([&](Field& field, std::string_view word) { field.count = parse_count(at, word); });
    } else if (key == "WIDTH") {
      header.width = parse_count(at, words.word());
      header.has_width = true;
    } else if (key == "HEIGHT") {
      header.height = parse_count(at, words.word());
    } else if (key == "POINTS") {
      header.points = parse_count(at, words.word());
      header.has_points = true;
    } else if (key == "VIEWPOINT") {
      parse_viewpoint(words, header);
    } else if (key == "DATA") {
      header.data = lower(words.word());
      if (header.data != "ascii" && header.data != "binary" && header.data != "binary_compressed")
        at.fail("unknown DATA " + shown(header.data));
    } else {
      if (in.at_end()) in.fail("the file is cut inside its header");
      at.fail("unknown header line " + shown(line));
    }
  }

  constexpr std::uint64_t kMost = UINT32_MAX - 1;
  if (header.has_width) {
    if (header.width > kMost || header.height > kMost || header.width * header.height > kMost)
      in.fail("the header claims " + std::to_string(header.width) + " x " + std::to_string(header.height) +
              " points; 4294967294 is the limit");
    if (!header.has_points) header.points = header.width * header.height;
    if (header.points != header.width * header.height)
      in.fail("POINTS is " + std::to_string(header.points) + ", but WIDTH x HEIGHT is " +
              std::to_string(header.width * header.height));
  }
  if (header.points > kMost)
    in.fail("the header claims " + std::to_string(header.points) + " points; 4294967294 is the limit");
  for (Field& field : header.fields) {
    const bool known = field.type == 'F' ? field.size == 4 || field.size == 8
                                         : (field.type == 'I' || field.type == 'U') &&
                                               std::has_single_bit(field.size) && field.size <= 8;
    if (!known || field.count > kLargestPoint)
      in.fail("the field '" + field.name + "' has an unknown type, size or count");
    field.offset = header.point_size;
    header.point_size += field.size * field.count;
    header.point_values += field.count;
    if (header.point_size > kLargestPoint) in.fail("a point of more than a megabyte");
  }
  return header;
}

double load(const unsigned char* at, const Field& field) {
  const auto as = [&]<class T>(T value) {
    std::memcpy(&value, at, sizeof(T));
    return static_cast<double>(value);
  };
  switch (field.type) {
    case 'F':
      return field.size == 4 ? as(float{}) : as(double{});
    case 'I':
      return field.size == 1   ? as(std::int8_t{})
             : field.size == 2 ? as(std::int16_t{})
             : field.size == 4 ? as(std::int32_t{})
                               : as(std::int64_t{});
    default:
      return field.size == 1   ? as(std::uint8_t{})
             : field.size == 2 ? as(std::uint16_t{})
             : field.size == 4 ? as(std::uint32_t{})
                               : as(std::uint64_t{});
  }
}

/// A packed colour is 4 bytes, blue first, whatever type the field claims.
std::uint32_t packed_color(double value, const Field& field) {
  if (field.type == 'F') return std::bit_cast<std::uint32_t>(static_cast<float>(value));
  if (!(value > -2147483649.0 && value < 4294967296.0)) return 0;
  return static_cast<std::uint32_t>(static_cast<std::int64_t>(value));
}

/// Where a field's values go.
struct Target {
  enum Kind { kSkip, kDouble, kFloat, kColor } kind = kSkip;
  char* to = nullptr;
  std::size_t stride = 0;
};

class PcdReader {
 public:
  PcdReader(std::string_view bytes, const std::string& file) : in_(bytes, file) {}

  RawScan read() {
    header_ = parse_header(in_);
    if (header_.points == 0) throw Error(ErrorKind::kInput, *in_.file, "has no points");
    check_fits();
    aim();
    if (header_.data == "ascii") {
      in_.end -= in_.remaining() - without_end_mark({in_.at, in_.remaining()}).size();
      read_ascii();
    } else if (header_.data == "binary") {
      const auto* at = reinterpret_cast<const unsigned char*>(in_.at);
      for (std::size_t f = 0; f < targets_.size(); ++f)
        read_column(f, at + header_.fields[f].offset, header_.point_size);
      in_.at += header_.points * header_.point_size;
      note_rest();
    } else {
      read_compressed();
    }
    scan_.viewpoints = std::move(header_.viewpoints);
    finish_colors();
    return std::move(scan_);
  }

 private:
  [[noreturn]] void fail_at_byte(const std::string& what) const {
    throw Error(ErrorKind::kInput, *in_.file, FilePlace{"byte", in_.byte()}, what);
  }
  [[noreturn]] void fail_count(std::uint64_t most) const {
    fail_at_byte("the header promises " + std::to_string(header_.points) +
                 " points, but there are bytes for " + std::to_string(most) +
                 " at most: the file is cut or its counts are wrong");
  }

  void check_fits() {
    if (header_.fields.empty()) in_.fail("the header has no FIELDS");
    if (header_.data == "binary_compressed") return;
    // A value of an ASCII point takes a digit and a space at least.
    const std::uint64_t entry = header_.data == "ascii" ? 2 * header_.point_values : header_.point_size;
    const std::uint64_t most = entry == 0 ? 0 : (in_.remaining() + (header_.data == "ascii")) / entry;
    if (header_.points > most) fail_count(most);
  }

  int find(std::string_view name) const {
    for (std::size_t i = 0; i < header_.fields.size(); ++i)
      if (lower(header_.fields[i].name) == name && header_.fields[i].count == 1) return static_cast<int>(i);
    return -1;
  }
  std::vector<std::string> single_names() const {
    std::vector<std::string> names;
    for (const Field& field : header_.fields) names.push_back(field.count == 1 ? field.name : "");
    return names;
  }

  /// Decides where every field goes. Called once it is known that the points can be there.
  void aim() {
    const auto& fields = header_.fields;
    // In compressed data the points are bounded by the bytes when it is unpacked, before which nothing is
    // allocated.
    if (header_.data == "binary_compressed") unpack();
    const auto count = static_cast<std::size_t>(header_.points);
    targets_.resize(fields.size());
    const std::vector<std::string> names = single_names();
    const auto aim_three = [&](const std::optional<NameTriple>& found, Target::Kind kind, auto& values,
                               std::size_t size) {
      if (!found) return false;
      values.resize(count);
      for (std::size_t i = 0; i < 3; ++i)
        targets_[(*found)[i]] = {kind, reinterpret_cast<char*>(values.data()) + i * (size / 3), size};
      return true;
    };
    if (!aim_three(find_position(names), Target::kDouble, scan_.positions, sizeof(Vec3d)))
      in_.fail("the header has no fields x, y and z");
    aim_three(find_normal(names), Target::kFloat, scan_.normals, sizeof(Vec3f));
    for (const char* name : {"rgb", "rgba"}) {
      const int field = find(name);
      if (field < 0 || fields[static_cast<std::size_t>(field)].size != 4) continue;
      packed_.resize(count);
      targets_[static_cast<std::size_t>(field)] = {Target::kColor, reinterpret_cast<char*>(packed_.data()),
                                                   sizeof(std::uint32_t)};
      keep_alpha_ = std::string_view(name) == "rgba";
      break;
    }
    if (const auto rgb = find_color(names); rgb && packed_.empty()) {
      aim_three(rgb, Target::kFloat, wide_colors_, sizeof(Vec3f));
      for (const std::size_t channel : *rgb) byte_colors_ &= fields[channel].size == 1;
    }
    scan_.properties.reserve(fields.size());
    for (std::size_t i = 0; i < fields.size(); ++i) {
      if (targets_[i].kind != Target::kSkip || fields[i].name == "_") continue;
      if (fields[i].count != 1) {
        scan_.notes.push_back("the field '" + fields[i].name + "' of " + std::to_string(fields[i].count) +
                              " values a point is not kept");
        continue;
      }
      if (lower(fields[i].name) == "radius") {
        scan_.radii.resize(count);
        targets_[i] = {Target::kFloat, reinterpret_cast<char*>(scan_.radii.data()), sizeof(float)};
        continue;
      }
      scan_.properties.push_back({fields[i].name, std::vector<float>(count)});
      targets_[i] = {Target::kFloat, reinterpret_cast<char*>(scan_.properties.back().values.data()),
                     sizeof(float)};
    }
  }

  void store(std::size_t field, std::size_t point, double value) {
    const Target& target = targets_[field];
    char* to = target.to + point * target.stride;
    switch (target.kind) {
      case Target::kSkip:
        break;
      case Target::kDouble:
        *reinterpret_cast<double*>(to) = value;
        break;
      case Target::kFloat:
        *reinterpret_cast<float*>(to) = static_cast<float>(value);
        break;
      case Target::kColor:
        *reinterpret_cast<std::uint32_t*>(to) = packed_color(value, header_.fields[field]);
        break;
    }
  }

  void read_column(std::size_t f, const unsigned char* at, std::size_t stride) {
    const Field& field = header_.fields[f];
    if (targets_[f].kind == Target::kSkip) return;
    const auto count = static_cast<std::size_t>(header_.points);
    if (targets_[f].kind == Target::kColor) {
      // Not through double, which would not keep the bits of a packed NaN.
      for (std::size_t i = 0; i < count; ++i)
        std::memcpy(&packed_[i], at + i * stride, sizeof(std::uint32_t));
      return;
    }
    for (std::size_t i = 0; i < count; ++i) store(f, i, load(at + i * stride, field));
  }

  void read_ascii() {
    for (std::size_t point = 0; point < header_.points; ++point) {
      const TextCursor at = in_;
      std::string_view line;
      if (!in_.next_line(line))
        in_.fail("the file is cut at point " + std::to_string(point) + " of " +
                 std::to_string(header_.points));
      TextCursor words(line, *in_.file);
      for (std::size_t f = 0; f < header_.fields.size(); ++f)
        for (std::size_t i = 0; i < header_.fields[f].count; ++i) {
          const std::string_view word = words.word();
          double value = 0;
          if (word.empty()) at.fail("point " + std::to_string(point) + " has too few values");
          if (read_number(word.data(), word.data() + word.size(), value) != word.data() + word.size())
            at.fail(shown(word) + " is not a number in point " + std::to_string(point));
          store(f, point, value);
        }
      if (!words.word().empty()) at.fail("point " + std::to_string(point) + " has too many values");
    }
    in_.skip_spaces();
    if (!in_.at_end()) in_.fail("there are more points than the header says; its count is wrong");
  }

  /// Compressed data: two sizes, then LZF; unpacked it has all values of the first field, then of the second,
  /// ...
  void unpack() {
    std::uint32_t sizes[2];
    if (in_.remaining() < sizeof(sizes)) fail_at_byte("the file is cut before its compressed data");
    std::memcpy(sizes, in_.at, sizeof(sizes));
    in_.at += sizeof(sizes);
    const std::uint64_t expected = header_.points * header_.point_size;
    if (sizes[0] > in_.remaining())
      fail_at_byte("the file is cut: " + std::to_string(sizes[0]) +
                   " bytes of compressed data are promised, " + std::to_string(in_.remaining()) +
                   " are there");
    if (sizes[1] != expected || expected / kLzfLargestRatio > sizes[0])
      fail_at_byte("the compressed data does not hold the " + std::to_string(header_.points) +
                   " points of the header; one of the counts is wrong");
    unpacked_.reset(new unsigned char[expected]);
    if (!lzf_decompress({reinterpret_cast<const unsigned char*>(in_.at), sizes[0]},
                        {unpacked_.get(), expected}))
      fail_at_byte("the compressed data is damaged");
    in_.at += sizes[0];
  }

  void read_compressed() {
    const unsigned char* at = unpacked_.get();
    for (std::size_t f = 0; f < targets_.size(); ++f) {
      const Field& field = header_.fields[f];
      read_column(f, at, field.size);
      at += field.size * field.count * header_.points;
    }
    unpacked_.reset();
    note_rest();
  }

  /// Some writers fill the last page with zeros.
  void note_rest() {
    if (std::any_of(in_.at, in_.end, [](char c) { return c != 0; }))
      scan_.notes.push_back(std::to_string(in_.remaining()) +
                            " bytes follow the last point and were ignored");
  }

  void finish_colors() {
    if (byte_colors_) {
      for (const Vec3f& c : wide_colors_)
        scan_.colors.push_back({to_color_byte(c.x), to_color_byte(c.y), to_color_byte(c.z)});
    } else if (!wide_colors_.empty()) {
      scan_.colors = colors_from_floats(wide_colors_);
    }
    if (packed_.empty()) return;
    scan_.colors.reserve(packed_.size());
    for (const std::uint32_t c : packed_)
      scan_.colors.push_back({static_cast<std::uint8_t>(c >> 16), static_cast<std::uint8_t>(c >> 8),
                              static_cast<std::uint8_t>(c)});
    const auto alpha = [](std::uint32_t c) { return c >> 24; };
    const bool same = std::all_of(packed_.begin(), packed_.end(),
                                  [&](std::uint32_t c) { return alpha(c) == alpha(packed_.front()); });
    if (!keep_alpha_ || same) return;
    ScalarProperty property{"alpha", {}};
    for (const std::uint32_t c : packed_) property.values.push_back(static_cast<float>(alpha(c)));
    scan_.properties.push_back(std::move(property));
  }

  TextCursor in_;
  Header header_;
  RawScan scan_;
  std::vector<Target> targets_;
  std::vector<std::uint32_t> packed_;
  std::vector<Vec3f> wide_colors_;
  std::unique_ptr<unsigned char[]> unpacked_;
  bool keep_alpha_ = false, byte_colors_ = true;
};

}  // namespace

bool is_pcd(std::string_view bytes) {
  static const std::string kNoFile;
  TextCursor in(bytes.substr(0, 4096), kNoFile);
  std::string_view line;
  while (in.next_line(line)) {
    TextCursor words(line, kNoFile);
    const std::string key = upper(words.word());
    if (key.empty()) continue;
    if (key[0] == '#') {
      if (line.find(".PCD v") != std::string_view::npos) return true;
      continue;
    }
    return key == "VERSION" || key == "FIELDS";
  }
  return false;
}

RawScan read_pcd(std::string_view bytes, const std::string& file) { return PcdReader(bytes, file).read(); }

}  // namespace rbvh
