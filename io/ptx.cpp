#include "io/ptx.h"

#include <array>
#include <optional>
#include <utility>

#include "io/colors.h"
#include "io/text_cursor.h"

namespace rbvh {
namespace {

constexpr std::size_t kMostNumbers = 7;  // x y z, intensity, red green blue

/// The numbers of a line; nothing where there is another word, or more than `most`.
std::optional<std::size_t> line_numbers(std::string_view line, const std::string& file, double* out,
                                        std::size_t most) {
  TextCursor words(line, file);
  std::size_t count = 0;
  for (std::string_view word; !(word = words.word()).empty(); ++count)
    if (count == most ||
        read_number(word.data(), word.data() + word.size(), out[count]) != word.data() + word.size())
      return std::nullopt;
  return count;
}

class PtxReader {
 public:
  PtxReader(std::string_view bytes, const std::string& file)
      : in_(without_end_mark(bytes), file), line_start_(in_) {}

  RawScan read() {
    while (in_.skip_spaces(), !in_.at_end()) read_one();
    if (scan_.positions.empty()) throw Error(ErrorKind::kInput, *in_.file, "has no points");
    if (scan_number_ == 1) scan_.object_ids.clear();
    if (!colors_.empty()) {
      colors_.resize(scan_.positions.size(), Vec3f{255, 255, 255});
      for (const Vec3f& c : colors_)
        scan_.colors.push_back({to_color_byte(c.x), to_color_byte(c.y), to_color_byte(c.z)});
    }
    scan_.properties.push_back({"intensity", std::move(intensities_)});
    if (empty_ > 0) scan_.notes.push_back(std::to_string(empty_) + " cells without a return were left out");
    return std::move(scan_);
  }

 private:
  void numbers(double* out, std::size_t count, const char* what) {
    line_start_ = in_;
    std::string_view line;
    if (!in_.next_line(line)) in_.fail(std::string("the file is cut before ") + what);
    if (line_numbers(line, *in_.file, out, count) != count)
      line_start_.fail(shown(line) + ": " + what + " is wanted here");
  }

  std::uint64_t count(const char* what) {
    double value = 0;
    numbers(&value, 1, what);
    if (!(value >= 0 && value < 4294967295.0) || value != std::floor(value))
      line_start_.fail(std::string(what) + " is no count");
    return static_cast<std::uint64_t>(value);
  }

  void read_one() {
    const std::uint64_t columns = count("the number of columns"), rows = count("the number of rows");
    std::array<double, 3> unused{};
    numbers(unused.data(), 3, "the scanner's position");
    for (int axis = 0; axis < 3; ++axis) numbers(unused.data(), 3, "a scanner's axis");
    // Points are rows that the matrix is multiplied to from the right.
    std::array<std::array<double, 4>, 4> matrix{};
    for (auto& row : matrix) numbers(row.data(), 4, "a row of the matrix");
    const Vec3d origin{matrix[3][0], matrix[3][1], matrix[3][2]};
    if (!is_finite(origin)) line_start_.fail("the scanner's position is not finite");
    // Four numbers of a digit and a space each.
    const std::uint64_t most = (in_.remaining() + 1) / 8;
    if (columns != 0 && rows > most / columns)
      line_start_.fail("the header promises " + std::to_string(columns) + " x " + std::to_string(rows) +
                       " points, but there are bytes for " + std::to_string(most) +
                       " at most: the file is cut or its counts are wrong");
    scan_.viewpoints.push_back(
        {.position = origin, .is_default = false, .first_object = scan_number_, .last_object = scan_number_});
    for (std::uint64_t i = 0; i < columns * rows; ++i) point(matrix, i, columns * rows);
    scan_.object_ids.resize(scan_.positions.size(), scan_number_++);
  }

  void point(const std::array<std::array<double, 4>, 4>& matrix, std::uint64_t index, std::uint64_t count) {
    line_start_ = in_;
    std::string_view line;
    double v[kMostNumbers] = {};
    if (!in_.next_line(line))
      in_.fail("the file is cut at point " + std::to_string(index) + " of " + std::to_string(count));
    const auto given = line_numbers(line, *in_.file, v, kMostNumbers);
    if (index == 0) numbers_ = given.value_or(0);
    if (given != numbers_ || (numbers_ != 4 && numbers_ != 7))
      line_start_.fail("point " + std::to_string(index) + " of " + std::to_string(count) +
                       " is not of 4 or 7 numbers, as many as the others");
    if (v[0] == 0 && v[1] == 0 && v[2] == 0) {
      ++empty_;
      return;
    }
    Vec3d p;
    for (std::size_t c = 0; c < 3; ++c)
      p[static_cast<int>(c)] = v[0] * matrix[0][c] + v[1] * matrix[1][c] + v[2] * matrix[2][c] + matrix[3][c];
    if (given == 7) {
      colors_.resize(scan_.positions.size(), Vec3f{255, 255, 255});
      colors_.push_back({static_cast<float>(v[4]), static_cast<float>(v[5]), static_cast<float>(v[6])});
    }
    scan_.positions.push_back(p);
    intensities_.push_back(static_cast<float>(v[3]));
  }

  TextCursor in_, line_start_;
  std::int32_t scan_number_ = 0;
  std::size_t empty_ = 0, numbers_ = 0;  ///< of a point
  std::vector<float> intensities_;
  std::vector<Vec3f> colors_;
  RawScan scan_;
};

}  // namespace

bool is_ptx(std::string_view bytes) {
  static const std::string kNoFile;
  TextCursor in(bytes.substr(0, 4096), kNoFile);
  std::string_view line;
  for (const std::size_t wanted : {1u, 1u, 3u, 3u, 3u, 3u, 4u, 4u, 4u, 4u}) {
    double values[4];
    if (!in.next_line(line) || line_numbers(line, kNoFile, values, 4) != wanted) return false;
  }
  return true;
}

RawScan read_ptx(std::string_view bytes, const std::string& file) { return PtxReader(bytes, file).read(); }

}  // namespace rbvh
