#include "io/xyz.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "io/colors.h"
#include "io/text_columns.h"
#include "io/text_cursor.h"
#include "pipeline/base/words.h"

namespace rbvh {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr int kMostHeaderLines = 32;
constexpr int kMostUnnamedLines = 3;  ///< of a file that only its content can tell

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

/// How alike two columns are: the correlation of their values; 1 where both are constant.
double correlation(const std::vector<float>& a, const std::vector<float>& b) {
  const auto n = static_cast<double>(a.size());
  double sum_a = 0, sum_b = 0, aa = 0, bb = 0, ab = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double x = a[i], y = b[i];
    sum_a += x;
    sum_b += y;
    aa += x * x;
    bb += y * y;
    ab += x * y;
  }
  const double va = aa - sum_a * sum_a / n, vb = bb - sum_b * sum_b / n;
  if (va <= 0 && vb <= 0) return 1;
  return va <= 0 || vb <= 0 ? 0 : (ab - sum_a * sum_b / n) / std::sqrt(va * vb);
}

class XyzReader {
 public:
  XyzReader(std::string_view bytes, const std::string& file, const TextColumns& given)
      : in_(without_end_mark(bytes), file),
        line_start_(in_),
        given_(given),
        is_pts_(lower(file).ends_with(".pts")) {}

  RawScan read() {
    std::string_view line;
    int header_lines = 0;
    for (;;) {
      line_start_ = in_;
      if (!in_.next_line(line)) break;
      if (line.find_first_not_of(" \t") == std::string_view::npos) continue;
      if (comment_text(line)) {
        if (scan_.positions.empty()) header_.push_back(line);
        continue;
      }
      if (!scan_.positions.empty()) {
        if (!next_scan(line)) point(line);
      } else if (!first_point(line)) {
        if (read_count(line)) continue;
        if (++header_lines > kMostHeaderLines) line_start_.fail(shown(line) + " has no three numbers");
        header_.push_back(line);
      }
    }
    if (scan_.positions.empty()) throw Error(ErrorKind::kInput, *in_.file, "has no line with three numbers");
    check_count();
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

  void check_count() const {
    const std::size_t count = scan_.positions.size() - scan_begin_;
    if (promised_ && *promised_ != count)
      in_.fail("the first line promises " + std::to_string(*promised_) + " points, but there are " +
               std::to_string(count) + ": the file is cut or its count is wrong");
  }

  /// Where all of a scan's points are there, a lone count begins another scan.
  bool next_scan(std::string_view line) {
    const std::size_t count = scan_.positions.size();
    if (!promised_ || *promised_ != count - scan_begin_) return false;
    const auto finished = std::exchange(promised_, std::nullopt);
    if (!read_count(line)) {
      promised_ = finished;
      return false;
    }
    scan_.object_ids.resize(count, scan_number_++);
    scan_begin_ = count;
    return true;
  }

  /// The first line with three numbers settles the separator, the columns and their names.
  bool first_point(std::string_view line) {
    const auto& cells = cells_.emplace(separator_of(line)).cut(line);
    cell_count_ = cells.size();
    if (cell_count_ < 3) return false;
    double value = 0;
    std::size_t numbers = 0;
    for (const std::string_view cell : cells) numbers += read_cell(cell, cells_->separator(), value);
    if (numbers < 3) return false;
    if (!given_.empty()) {
      take_given();
    } else if (auto found = find_column_names(header_, cell_count_, *in_.file)) {
      names_ = std::move(found->names);
      position_ = found->position;
    }
    for (const std::size_t axis : position_)
      if (!read_cell(cells[axis], cells_->separator(), value)) {
        if (numbers == cell_count_ || !names_.empty()) return false;
        throw ColumnsUnknown(
            ErrorKind::kInput, *in_.file, FilePlace{"line", line_start_.line()},
            shown(cells[axis]) + " is no coordinate: say at ingest which columns are x, y, z");
      }
    for (std::size_t i = 0; i < cell_count_; ++i) {
      if (std::find(position_.begin(), position_.end(), i) != position_.end()) continue;
      columns_.emplace_back().name = names_.empty() ? "" : names_[i];
      column_at_.push_back(i);
    }
    point(line);
    return true;
  }

  /// The columns as the caller names them.
  void take_given() {
    names_.assign(cell_count_, "");
    for (const auto& [name, column] : given_) {
      if (column < 1 || column > cell_count_)
        line_start_.fail("there is no column " + std::to_string(column) + ": this line has " +
                         std::to_string(cell_count_));
      names_[column - 1] = name;
    }
    const auto position = find_position(names_);
    if (!position) throw Error(ErrorKind::kUsage, *in_.file, "the columns of x, y and z are wanted");
    position_ = *position;
  }

  void point(std::string_view line) {
    const auto& cells = cells_->cut(line);
    // Cells at the end of a line may be empty.
    const std::size_t least = 1 + *std::max_element(position_.begin(), position_.end());
    if (cells.size() > cell_count_ || cells.size() < least ||
        (cells.size() < cell_count_ && line.back() != cells_->separator()))
      line_start_.fail("a line of " + std::to_string(cells.size()) + " columns, where the others have " +
                       std::to_string(cell_count_));
    Vec3d p;
    for (int axis = 0; axis < 3; ++axis) {
      const std::string_view cell = cells[position_[static_cast<std::size_t>(axis)]];
      if (!read_cell(cell, cells_->separator(), p[axis])) line_start_.fail(shown(cell) + " is not a number");
    }
    scan_.positions.push_back(p);
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      double value = kNan;
      const std::string_view cell = column_at_[i] < cells.size() ? cells[column_at_[i]] : std::string_view();
      if (!cell.empty() && !read_cell(cell, cells_->separator(), value)) {
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

  std::vector<std::string> column_names() const {
    std::vector<std::string> names;
    for (const Column& column : columns_) names.push_back(column.name);
    return names;
  }

  /// Of four columns of bytes: whether the intensity is the first. It is like its neighbour less than a
  /// colour's channel is.
  bool intensity_first() {
    if (columns_.size() != 4 || !are_colors(1)) return false;
    if (is_pts_ || !are_colors(0)) return true;
    const bool first = correlation(columns_[0].values, columns_[1].values) <
                       correlation(columns_[3].values, columns_[2].values);
    scan_.notes.push_back(std::string("four columns of 0 to 255 follow the position, and were taken as ") +
                          (first ? "intensity, red, green, blue" : "red, green, blue, intensity"));
    return first;
  }

  void give_meaning() {
    if (scan_number_ > 0) scan_.object_ids.resize(scan_.positions.size(), scan_number_);
    std::vector<bool> taken(columns_.size());
    std::vector<Vec3f> colors;
    const auto take = [&](const std::optional<NameTriple>& found, std::vector<Vec3f>& into) {
      if (!found) return;
      into = three((*found)[0], (*found)[1], (*found)[2]);
      for (const std::size_t i : *found) taken[i] = true;
    };
    if (!names_.empty()) {
      take(find_normal(column_names()), scan_.normals);
      take(find_color(column_names()), colors);
    } else {
      for (std::size_t i = intensity_first() ? 1 : 0; i + 2 < columns_.size();) {
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
      note_counter();
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

  /// 1, 2, 3, ... in the first of more than three columns is rarely an x.
  void note_counter() {
    const std::size_t count = scan_.positions.size();
    if (columns_.empty() || count < 3) return;
    for (std::size_t i = 1; i < count; ++i)
      if (scan_.positions[i].x != scan_.positions[0].x + static_cast<double>(i)) return;
    scan_.notes.push_back(
        "the first column counts the points, but was taken for x, as there is no header: are columns 2 to 4 "
        "the position?");
  }

  TextCursor in_, line_start_;
  TextColumns given_;
  bool is_pts_;
  std::optional<Cells> cells_;
  std::vector<std::string_view> header_;  ///< comments and header lines
  std::vector<std::string> names_;        ///< a name a column, if the file has them
  NameTriple position_{0, 1, 2};
  std::vector<Column> columns_;
  std::vector<std::size_t> column_at_;
  std::size_t cell_count_ = 0, texts_ = 0, scan_begin_ = 0;
  std::int32_t scan_number_ = 0;
  std::optional<std::uint64_t> promised_;
  RawScan scan_;
};

}  // namespace

bool is_xyz(std::string_view bytes) {
  static const std::string kNoFile;
  // The last line of these bytes may be cut in the middle, which does not matter here.
  TextCursor in(bytes.substr(0, 65536), kNoFile);
  std::string_view line;
  for (int lines = 0; lines <= kMostUnnamedLines && in.next_line(line);) {
    if (comment_text(line) || line.find_first_not_of(" \t") == std::string_view::npos) continue;
    ++lines;
    Cells cells(separator_of(line));
    int numbers = 0;
    for (const std::string_view cell : cells.cut(line)) {
      double value = 0;
      if (!read_cell(cell, cells.separator(), value)) break;
      ++numbers;
    }
    if (numbers >= 3) return true;
  }
  return false;
}

RawScan read_xyz_columns(std::string_view bytes, const std::string& file, const TextColumns& columns) {
  return XyzReader(bytes, file, columns).read();
}

RawScan read_xyz(std::string_view bytes, const std::string& file) {
  return read_xyz_columns(bytes, file, {});
}

TextColumns parse_text_columns(std::string_view text) {
  TextColumns columns;
  for (const std::string& word : parse_list(text)) {
    const std::size_t equals = word.find('=');
    if (equals == 0 || equals == std::string::npos)
      throw Error(ErrorKind::kUsage, "", "'" + word + "' is not NAME=NUMBER");
    columns.emplace_back(word.substr(0, equals),
                         static_cast<std::size_t>(parse_positive(word.substr(equals + 1))));
  }
  return columns;
}

}  // namespace rbvh
