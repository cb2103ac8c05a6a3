#include "io/off.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "io/colors.h"
#include "io/property_names.h"
#include "io/text_cursor.h"
#include "pipeline/scan/cut_polygons.h"

namespace rbvh {
namespace {

struct Variant {
  bool texture = false, color = false, normal = false, homogeneous = false, n_dimensional = false;
  bool normal_before_color = false;  ///< in the keyword: NCOFF, as MeshLab writes it
};

/// Takes [ST][C][N][4][n]OFF off the start of `word`: in any case, the first two in any order. What is left
/// may be the first count, glued to it.
bool take_keyword(std::string_view& word, Variant& variant) {
  std::string_view rest = word;
  const auto take = [&](std::string_view prefix) {
    const bool has = lower(rest.substr(0, prefix.size())) == prefix;
    if (has) rest.remove_prefix(prefix.size());
    return has;
  };
  for (bool more = true; more;) {
    // "nOFF" has n dimensions; where all is lower case, 'n' is for normals.
    const bool dimensions = rest.starts_with("nOFF") || (rest.starts_with("n") && variant.homogeneous);
    if (dimensions && take("n")) {
      variant.n_dimensional = true;
    } else if (take("st")) {
      variant.texture = true;
    } else if (take("c")) {
      variant.color = true;
    } else if (take("n")) {
      variant.normal = true;
      variant.normal_before_color = !variant.color;
    } else if (take("4")) {
      variant.homogeneous = true;
    } else {
      more = false;
    }
  }
  if (!take("off")) return false;
  if (!rest.empty() && rest.find_first_not_of("0123456789") != std::string_view::npos) return false;
  word = rest;
  return true;
}

/// All but one in a hundred, apart from zeros.
bool are_unit(const std::vector<Vec3f>& vectors) {
  std::size_t unit = 0, other = 0;
  for (const Vec3f& v : vectors)
    if (const float l = length(v); l != 0) ++(l > 0.98f && l < 1.02f ? unit : other);
  return unit > 0 && other <= unit / 100;
}

class OffReader {
 public:
  OffReader(std::string_view bytes, const std::string& file)
      : in_(without_end_mark(bytes), file), line_start_(in_) {}

  RawScan read() {
    read_header();
    read_vertices();
    read_faces();
    if (next()) line_start_.fail("there is more data than the counts say; one of them is wrong");
    return std::move(scan_);
  }

 private:
  /// Goes to the next line that has something; comments are cut off.
  bool next() {
    for (;;) {
      line_start_ = in_;
      std::string_view line;
      if (!in_.next_line(line)) return false;
      line = line.substr(0, line.find('#'));
      if (TextCursor(line, *in_.file).word().empty()) continue;
      line_ = line;
      return true;
    }
  }
  void next_or_fail(const char* what, std::uint64_t index, std::uint64_t count) {
    if (!next())
      in_.fail("the file is cut at " + std::string(what) + " " + std::to_string(index) + " of " +
               std::to_string(count));
  }

  void read_header() {
    if (!next()) in_.fail("is no OFF file: it has no line");
    TextCursor words(line_, *in_.file);
    const char* start = words.at;
    std::string_view word = words.word();
    if (take_keyword(word, variant_)) {
      words.at = word.empty() ? words.at : word.data();
      if (const TextCursor here = words; lower(words.word()) == "binary") {
        line_start_.fail("a binary OFF file, which is not supported; convert it to PLY");
      } else {
        words = here;
      }
      if (TextCursor(words).word().empty()) {
        if (!next()) in_.fail("the file is cut before its line of counts");
        words = TextCursor(line_, *in_.file);
      }
    } else {
      variant_ = {};
      words.at = start;
    }
    if (variant_.n_dimensional) line_start_.fail("an OFF file of n dimensions, which is not supported");
    std::uint64_t counts[3] = {0, 0, 0};
    for (int i = 0; i < 3; ++i) {
      const std::string_view word = words.word();
      if (word.empty() && i == 2) break;  // the count of edges is often missing
      const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), counts[i]);
      if (word.empty() || error != std::errc() || end != word.data() + word.size())
        line_start_.fail("not an OFF file, or its line of counts is wrong");
    }
    vertex_count_ = counts[0];
    face_count_ = counts[1];
    // Three numbers of a digit and a space each, a count and a line's end: no entry is shorter.
    const std::uint64_t left = in_.remaining() + 1;
    if (vertex_count_ > left / 6 || face_count_ > (left - 6 * vertex_count_) / 2)
      line_start_.fail("the counts promise " + std::to_string(vertex_count_) + " vertices and " +
                       std::to_string(face_count_) + " faces, but only " + std::to_string(in_.remaining()) +
                       " bytes are left: the file is cut or its counts are wrong");
    if (vertex_count_ == 0) throw Error(ErrorKind::kInput, *in_.file, "has no vertices");
  }

  void read_vertices() {
    const int base = variant_.homogeneous ? 4 : 3;
    const int after_position = base + (variant_.normal ? 3 : 0);
    scan_.positions.reserve(vertex_count_);
    std::vector<Vec3f> colors, early_colors, late_normals;
    int columns = -1;
    bool has_color = variant_.color;
    for (std::uint64_t i = 0; i < vertex_count_; ++i) {
      next_or_fail("vertex", i, vertex_count_);
      double values[16];
      int count = 0;
      TextCursor words(line_, *in_.file);
      for (std::string_view word; !(word = words.word()).empty(); ++count) {
        if (count == 16) line_start_.fail("a vertex of more than 16 numbers");
        if (read_number(word.data(), word.data() + word.size(), values[count]) != word.data() + word.size())
          line_start_.fail(shown(word) + " is not a number in vertex " + std::to_string(i));
      }
      if (columns < 0) {
        columns = count;
        const int rest = count - after_position - (variant_.texture ? 2 : 0);
        has_color = rest == 3 || rest == 4;
        if (rest < 0 || (variant_.color && !has_color))
          line_start_.fail("vertex " + std::to_string(i) + " has " + std::to_string(count) +
                           " numbers, too few");
      }
      if (count != columns)
        line_start_.fail("vertex " + std::to_string(i) + " has " + std::to_string(count) +
                         " numbers, the others have " + std::to_string(columns));
      Vec3d p{values[0], values[1], values[2]};
      if (variant_.homogeneous) p = {p.x / values[3], p.y / values[3], p.z / values[3]};
      scan_.positions.push_back(p);
      const auto vec3f = [&](int at) {
        return Vec3f{static_cast<float>(values[at]), static_cast<float>(values[at + 1]),
                     static_cast<float>(values[at + 2])};
      };
      if (variant_.normal) scan_.normals.push_back(vec3f(base));
      if (has_color) colors.push_back(vec3f(after_position));
      if (!variant_.normal || !has_color) continue;
      early_colors.push_back(vec3f(base));
      late_normals.push_back(vec3f(columns - 3 - (variant_.texture ? 2 : 0)));
    }
    // The normal comes before the colour, but in MeshLab's NCOFF behind it.
    const bool early = are_unit(scan_.normals), late = are_unit(late_normals);
    if (late && (!early || variant_.normal_before_color)) {
      colors = std::move(early_colors);
      scan_.normals = std::move(late_normals);
    }
    if (has_color) scan_.colors = colors_from_floats(colors);
    if (variant_.texture) scan_.notes.push_back("the texture coordinates are not kept");
  }

  void read_faces() {
    std::uint64_t colored = 0, too_short = 0;
    Fans fans;
    scan_.triangles.reserve(face_count_);
    for (std::uint64_t i = 0; i < face_count_; ++i) {
      next_or_fail("face", i, face_count_);
      TextCursor words(line_, *in_.file);
      const auto integer = [&] {
        const std::string_view word = words.word();
        std::int64_t value = 0;
        const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
        if (word.empty() || error != std::errc() || end != word.data() + word.size())
          line_start_.fail("face " + std::to_string(i) +
                           (word.empty() ? " is cut" : ": " + shown(word) + " is no index"));
        return value;
      };
      const std::int64_t corners = integer();
      if (corners < 0) line_start_.fail("face " + std::to_string(i) + " has a negative number of corners");
      too_short += corners < 3;
      std::uint32_t first = 0, last = 0;
      for (std::int64_t c = 0; c < corners; ++c) {
        const std::int64_t index = integer();
        if (index < 0 || index >= static_cast<std::int64_t>(vertex_count_))
          line_start_.fail("face " + std::to_string(i) + ": the vertex index " + std::to_string(index) +
                           " is out of range (there are " + std::to_string(vertex_count_) + " vertices)");
        const auto corner = static_cast<std::uint32_t>(index);
        if (c == 0) first = corner;
        if (c >= 2) scan_.triangles.push_back({first, last, corner});
        last = corner;
      }
      if (corners >= 3) fans.add(scan_.triangles.size(), static_cast<std::size_t>(corners) - 2);
      colored += !words.word().empty();
    }
    add_notes(fans.cut_again(scan_.positions, scan_.triangles), scan_.notes);
    if (colored > 0)
      scan_.notes.push_back("the colours of " + std::to_string(colored) + " faces are not kept");
    if (too_short > 0)
      scan_.notes.push_back(std::to_string(too_short) + " faces with fewer than three corners were left out");
  }

  TextCursor in_, line_start_;
  std::string_view line_;
  Variant variant_;
  std::uint64_t vertex_count_ = 0, face_count_ = 0;
  RawScan scan_;
};

}  // namespace

bool is_off(std::string_view bytes) {
  static const std::string kNoFile;
  Variant variant;
  std::string_view word = TextCursor(bytes.substr(0, 64), kNoFile).word();
  return take_keyword(word, variant);
}

RawScan read_off(std::string_view bytes, const std::string& file) { return OffReader(bytes, file).read(); }

}  // namespace rbvh
