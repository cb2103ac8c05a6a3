#include "io/xyz.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <utility>

#include "io/colors.h"
#include "io/text_cursor.h"

namespace rbvh {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr int kMostHeaderLines = 2;

/// One column beside the position, and what is needed to tell its meaning.
struct Column {
  std::string name;
  std::vector<float> values;
  bool bytes = true;      ///< integers in 0..255
  bool fractions = true;  ///< in [0, 1]

  void add(double value) {
    values.push_back(static_cast<float>(value));
    bytes &= value >= 0 && value <= 255 && value == std::floor(value);
    fractions &= value >= 0 && value <= 1;
  }
};

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return result;
}

/// Cuts a line into cells. With a comma or semicolon between them cells may be empty.
class Cells {
 public:
  explicit Cells(char separator) : separator_(separator) {}

  const std::vector<std::string_view>& cut(std::string_view line) {
    cells_.clear();
    const char* at = line.data();
    const char* end = at + line.size();
    const auto blank = [&](char c) { return is_blank(c); };
    for (;;) {
      while (at < end && blank(*at)) ++at;
      if (separator_ == ' ' && at == end) return cells_;
      const char* first = at;
      while (at < end && (separator_ == ' ' ? !blank(*at) : *at != separator_)) ++at;
      const char* last = at;
      while (last > first && blank(last[-1])) --last;
      if (last - first >= 2 && *first == '"' && last[-1] == '"') ++first, --last;
      const bool is_last = at == end;
      // A separator at the end of a line is no further cell.
      if (!(is_last && first == last)) cells_.push_back({first, static_cast<std::size_t>(last - first)});
      if (is_last) return cells_;
      ++at;
    }
  }

 private:
  char separator_;
  std::vector<std::string_view> cells_;
};

char separator_of(std::string_view line) {
  if (line.find(';') != std::string_view::npos) return ';';
  return line.find(',') != std::string_view::npos ? ',' : ' ';
}

/// The text of a comment, without what starts it; nothing for other lines.
std::optional<std::string_view> comment(std::string_view line) {
  const std::size_t start = line.find_first_not_of(" \t");
  if (start == std::string_view::npos) return std::nullopt;
  line.remove_prefix(start);
  if (line[0] != '#' && line.substr(0, 2) != "//") return std::nullopt;
  line.remove_prefix(std::min(line.find_first_not_of("#/ \t"), line.size()));
  return line;
}

class XyzReader {
 public:
  XyzReader(std::string_view bytes, const std::string& file)
      : in_(bytes, file), line_start_(in_), is_pts_(lower(file).ends_with(".pts")) {
    constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
    if (bytes.substr(0, 3) == kByteOrderMark) in_.at += 3;
  }

  RawScan read() {
    std::string_view line;
    int header_lines = 0;
    for (;;) {
      line_start_ = in_;
      if (!in_.next_line(line)) break;
      if (line.find_first_not_of(" \t") == std::string_view::npos) continue;
      if (const auto text = comment(line)) {
        if (scan_.positions.empty()) names_.push_back(*text);
        continue;
      }
      if (!scan_.positions.empty()) {
        point(line);
      } else if (!first_point(line)) {
        if (read_count(line)) continue;
        if (++header_lines > kMostHeaderLines) line_start_.fail(shown(line) + " has no three numbers");
        names_.push_back(line);
      }
    }
    if (scan_.positions.empty()) throw Error(ErrorKind::kInput, *in_.file, "has no line with three numbers");
    if (promised_ && *promised_ != scan_.positions.size())
      in_.fail("the first line promises " + std::to_string(*promised_) + " points, but there are " +
               std::to_string(scan_.positions.size()) + ": the file is cut or its count is wrong");
    give_meaning();
    return std::move(scan_);
  }

 private:
  /// PTS begins with the number of its points.
  bool read_count(std::string_view line) {
    if (promised_) return false;
    TextCursor words(line, *in_.file);
    const std::string_view word = words.word();
    std::uint64_t count = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), count);
    if (error != std::errc() || end != word.data() + word.size() || !words.word().empty()) return false;
    promised_ = count;
    return true;
  }

  /// The first line with three numbers settles the separator, the columns and their names.
  bool first_point(std::string_view line) {
    cells_ = Cells(separator_of(line));
    decimal_comma_ = separator_of(line) == ';';
    const auto& cells = cells_.cut(line);
    const std::size_t columns = cells.size();
    if (columns < 3) return false;
    find_names(columns);
    cells_.cut(line);
    double value = 0;
    for (const std::size_t axis : position_)
      if (!number(cells[axis], value)) return false;
    for (std::size_t i = 0; i < columns; ++i) {
      if (std::find(position_.begin(), position_.end(), i) != position_.end()) continue;
      columns_.emplace_back().name = header_.empty() ? "" : header_[i];
      column_at_.push_back(i);
    }
    cell_count_ = columns;
    point(line);
    return true;
  }

  /// Looks for a header with one name a column, x, y and z among them.
  void find_names(std::size_t columns) {
    position_ = {0, 1, 2};
    header_.clear();
    for (const std::string_view text : names_) {
      const auto cells = Cells(separator_of(text)).cut(text);
      if (cells.size() != columns) continue;
      std::vector<std::string> names(cells.begin(), cells.end());
      std::array<std::size_t, 3> found{};
      bool all = true;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::string wanted(1, "xyz"[axis]);
        const auto at = std::find_if(names.begin(), names.end(),
                                     [&](const std::string& n) { return lower(n) == wanted; });
        found[axis] = static_cast<std::size_t>(at - names.begin());
        all &= at != names.end();
      }
      if (!all) continue;
      position_ = found;
      header_ = std::move(names);
    }
  }

  bool number(std::string_view cell, double& value) {
    if (decimal_comma_ && cell.find(',') != std::string_view::npos) {
      replaced_.assign(cell);
      std::replace(replaced_.begin(), replaced_.end(), ',', '.');
      cell = replaced_;
    }
    return !cell.empty() &&
           read_number(cell.data(), cell.data() + cell.size(), value) == cell.data() + cell.size();
  }

  void point(std::string_view line) {
    const auto& cells = cells_.cut(line);
    // Cells at the end of a line may be empty.
    const std::size_t least = 1 + *std::max_element(position_.begin(), position_.end());
    if (cells.size() > cell_count_ || cells.size() < least ||
        (cells.size() < cell_count_ && line.back() != ',' && line.back() != ';'))
      line_start_.fail("a line of " + std::to_string(cells.size()) + " columns, where the others have " +
                       std::to_string(cell_count_));
    Vec3d p;
    for (int axis = 0; axis < 3; ++axis) {
      const std::string_view cell = cells[position_[static_cast<std::size_t>(axis)]];
      if (!number(cell, p[axis])) line_start_.fail(shown(cell) + " is not a number");
    }
    scan_.positions.push_back(p);
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      double value = kNan;
      const std::string_view cell = column_at_[i] < cells.size() ? cells[column_at_[i]] : std::string_view();
      if (!cell.empty() && !number(cell, value)) {
        ++texts_;
        value = kNan;
      }
      columns_[i].add(value);
    }
  }

  // --- what the columns mean
  // --------------------------------------------------------------------------------------

  std::vector<Vec3f> three(std::size_t x, std::size_t y, std::size_t z) const {
    std::vector<Vec3f> vectors(scan_.positions.size());
    for (std::size_t i = 0; i < vectors.size(); ++i)
      vectors[i] = {columns_[x].values[i], columns_[y].values[i], columns_[z].values[i]};
    return vectors;
  }

  /// Of unit length to 2%, but for one in a hundred; zero stands for "none".
  static bool are_normals(const std::vector<Vec3f>& vectors) {
    std::size_t unit = 0, other = 0;
    for (const Vec3f& v : vectors) {
      const float l = length(v);
      if (l == 0.0f) continue;
      ++(l > 0.98f && l < 1.02f ? unit : other);
    }
    return unit > 0 && other <= unit / 100;
  }

  bool are_colors(std::size_t first) const {
    const auto all = [&](bool Column::*flag) {
      return columns_[first].*flag && columns_[first + 1].*flag && columns_[first + 2].*flag;
    };
    return all(&Column::bytes) || all(&Column::fractions);
  }

  void take_named(const std::vector<std::array<const char*, 3>>& spellings, std::vector<bool>& taken,
                  std::vector<Vec3f>& into) {
    for (const auto& spelling : spellings) {
      std::array<std::size_t, 3> found{};
      bool all = true;
      for (std::size_t c = 0; c < 3; ++c) {
        while (found[c] < columns_.size() && lower(columns_[found[c]].name) != spelling[c]) ++found[c];
        all &= found[c] < columns_.size() && !taken[found[c]];
      }
      if (!all) continue;
      into = three(found[0], found[1], found[2]);
      for (const std::size_t i : found) taken[i] = true;
      return;
    }
  }

  void give_meaning() {
    std::vector<bool> taken(columns_.size());
    std::vector<Vec3f> colors;
    if (!header_.empty()) {
      take_named({{"nx", "ny", "nz"}, {"normal_x", "normal_y", "normal_z"}}, taken, scan_.normals);
      take_named({{"red", "green", "blue"}, {"r", "g", "b"}, {"rf", "gf", "bf"}}, taken, colors);
    } else {
      const bool intensity_first = is_pts_ && columns_.size() == 4 && are_colors(1);
      for (std::size_t i = intensity_first ? 1 : 0; i + 2 < columns_.size();) {
        std::vector<Vec3f> vectors = three(i, i + 1, i + 2);
        const bool normals = scan_.normals.empty() && are_normals(vectors);
        const bool color = !normals && colors.empty() && are_colors(i);
        if (normals)
          scan_.normals = std::move(vectors);
        else if (color)
          colors = std::move(vectors);
        if (normals || color) taken[i] = taken[i + 1] = taken[i + 2] = true;
        i += normals || color ? 3 : 1;
      }
    }
    if (!colors.empty()) scan_.colors = colors_from_floats(colors);
    int unnamed = 0;
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (taken[i]) continue;
      std::string name = columns_[i].name;
      if (name.empty()) name = unnamed++ == 0 ? "intensity" : "scalar_" + std::to_string(unnamed);
      if (lower(name) == "radius") {
        scan_.radii = std::move(columns_[i].values);
      } else {
        scan_.properties.push_back({std::move(name), std::move(columns_[i].values)});
      }
    }
    if (texts_ > 0)
      scan_.notes.push_back(std::to_string(texts_) + " cells are no numbers and were read as NaN");
  }

  TextCursor in_, line_start_;
  bool is_pts_;
  Cells cells_{' '};
  bool decimal_comma_ = false;
  std::string replaced_;
  std::vector<std::string_view> names_;  ///< comments and header lines
  std::vector<std::string> header_;      ///< a name a column, if the file has them
  std::array<std::size_t, 3> position_{0, 1, 2};
  std::vector<Column> columns_;
  std::vector<std::size_t> column_at_;
  std::size_t cell_count_ = 0, texts_ = 0;
  std::optional<std::uint64_t> promised_;
  RawScan scan_;
};

}  // namespace

bool is_xyz(std::string_view bytes) {
  static const std::string kNoFile;
  // The last line of these bytes may be cut in the middle, which does not matter here.
  TextCursor in(bytes.substr(0, 65536), kNoFile);
  std::string_view line;
  for (int lines = 0; lines <= kMostHeaderLines + 1 && in.next_line(line);) {
    if (comment(line) || line.find_first_not_of(" \t") == std::string_view::npos) continue;
    ++lines;
    const auto cells = Cells(separator_of(line)).cut(line);
    int numbers = 0;
    for (const std::string_view cell : cells) {
      double value = 0;
      if (cell.empty() || !read_number(cell.data(), cell.data() + cell.size(), value)) break;
      ++numbers;
    }
    if (numbers >= 3) return true;
  }
  return false;
}

RawScan read_xyz(std::string_view bytes, const std::string& file) { return XyzReader(bytes, file).read(); }

}  // namespace rbvh
