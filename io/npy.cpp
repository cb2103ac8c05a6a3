// A .npy file: "\x93NUMPY", version (2 bytes), length of the header (2 or 4 bytes), the header (a Python
// literal:
// {'descr': '<f4', 'fortran_order': False, 'shape': (3, 6), }, padded with spaces to a newline), the values.
#include "io/npy.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <optional>

#include "io/input_file.h"
#include "io/output_file.h"
#include "pipeline/base/error.h"
#include "pipeline/base/memory_budget.h"

namespace rbvh {
namespace {

static_assert(std::endian::native == std::endian::little);
constexpr std::string_view kMagic = "\x93NUMPY";
constexpr std::size_t kHeaderAlignment = 64;
constexpr std::size_t kLongestHeader = 1 << 20;

struct Header {
  std::string descr;
  bool fortran_order = false;
  std::vector<std::uint64_t> shape;
};

// Reads the few Python literals that a header is made of; every member is false or empty where the text is
// something else.
class LiteralReader {
 public:
  explicit LiteralReader(std::string_view text) : text_(text) {}

  bool take(char c) {
    skip_space();
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  bool at_end() {
    skip_space();
    return at_ == text_.size();
  }
  std::optional<std::string> string() {
    skip_space();
    if (at_ >= text_.size() || (text_[at_] != '\'' && text_[at_] != '"')) return {};
    const std::size_t end = text_.find(text_[at_], at_ + 1);
    if (end == std::string_view::npos) return {};
    const std::string value(text_.substr(at_ + 1, end - at_ - 1));
    at_ = end + 1;
    return value;
  }
  std::optional<bool> boolean() {
    if (word("True")) return true;
    if (word("False")) return false;
    return {};
  }
  std::optional<std::vector<std::uint64_t>> tuple() {
    if (!take('(')) return {};
    std::vector<std::uint64_t> values;
    while (!take(')')) {
      const std::optional<std::uint64_t> value = number();
      if (!value) return {};
      values.push_back(*value);
      if (take(',')) continue;
      if (!take(')')) return {};
      break;
    }
    return values;
  }

 private:
  void skip_space() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n' || text_[at_] == '\t')) ++at_;
  }
  bool word(std::string_view wanted) {
    skip_space();
    if (!text_.substr(at_).starts_with(wanted)) return false;
    at_ += wanted.size();
    return true;
  }
  std::optional<std::uint64_t> number() {
    skip_space();
    const std::size_t start = at_;
    std::uint64_t value = 0;
    for (; at_ < text_.size() && text_[at_] >= '0' && text_[at_] <= '9'; ++at_) {
      const auto digit = static_cast<std::uint64_t>(text_[at_] - '0');
      if (value > (std::numeric_limits<std::uint64_t>::max() - digit) / 10) return {};
      value = value * 10 + digit;
    }
    return at_ > start ? std::optional(value) : std::nullopt;
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

std::optional<Header> parse_header(std::string_view text) {
  LiteralReader in(text);
  std::optional<std::string> descr;
  std::optional<bool> fortran_order;
  std::optional<std::vector<std::uint64_t>> shape;
  if (!in.take('{')) return {};
  while (!in.take('}')) {
    const std::optional<std::string> key = in.string();
    if (!key || !in.take(':')) return {};
    bool is_read = false;
    if (*key == "descr") is_read = (descr = in.string()).has_value();
    if (*key == "fortran_order") is_read = (fortran_order = in.boolean()).has_value();
    if (*key == "shape") is_read = (shape = in.tuple()).has_value();
    if (!is_read) return {};
    if (in.take(',')) continue;
    if (!in.take('}')) return {};
    break;
  }
  if (!in.at_end() || !descr || !fortran_order || !shape) return {};
  return Header{*descr, *fortran_order, *shape};
}

std::string shape_text(const std::vector<std::uint64_t>& shape) {
  std::string text = "(";
  for (std::size_t i = 0; i < shape.size() && i < 8; ++i)
    text += (i > 0 ? ", " : "") + std::to_string(shape[i]);
  return text + (shape.size() > 8 ? ", ...)" : shape.size() == 1 ? ",)" : ")");
}

std::string columns_text(std::span<const std::size_t> columns) {
  std::string text;
  for (const std::size_t c : columns) text += (text.empty() ? "(N, " : " or (N, ") + std::to_string(c) + ")";
  return text;
}

std::uint32_t little_endian(std::string_view bytes) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data(), bytes.size());
  return value;
}

struct Shape {
  std::uint64_t rows = 0, columns = 0;
  std::size_t data_at = 0;  ///< bytes before the values

  std::size_t value_bytes = sizeof(float);

  std::uint64_t row_bytes() const { return columns * value_bytes; }
};

/// From bytes that hold the header, or all there are.
Shape parse_shape(std::string_view bytes, const std::string& name, std::span<const std::size_t> columns) {
  const auto refuse = [&](const std::string& what) { return Error(ErrorKind::kInput, name, what); };
  if (!bytes.starts_with(kMagic)) throw refuse("is no .npy file: it does not begin with \\x93NUMPY");
  if (bytes.size() < 8)
    throw refuse("is cut at byte " + std::to_string(bytes.size()) + ", before its version");
  const auto major = static_cast<unsigned char>(bytes[6]), minor = static_cast<unsigned char>(bytes[7]);
  if (major < 1 || major > 3 || minor != 0)
    throw refuse("is of .npy version " + std::to_string(major) + "." + std::to_string(minor) +
                 "; 1.0, 2.0 and 3.0 can be read");
  const std::size_t length_bytes = major == 1 ? 2 : 4, header_at = 8 + length_bytes;
  if (bytes.size() < header_at || bytes.size() - header_at < little_endian(bytes.substr(8, length_bytes)))
    throw refuse("is cut at byte " + std::to_string(bytes.size()) + ", within its header");
  const std::size_t data_at = header_at + little_endian(bytes.substr(8, length_bytes));
  const std::optional<Header> header = parse_header(bytes.substr(header_at, data_at - header_at));
  if (!header)
    throw refuse("has a header at byte " + std::to_string(header_at) +
                 " that is not a plain array's; save a 2-D float32 array with numpy.save");

  if (header->descr != "<f4" && header->descr != "<f8")
    throw refuse("has values of type '" + header->descr.substr(0, 16) +
                 "'; '<f4' or '<f8' is wanted: save it with array.astype('<f4')");
  if (header->fortran_order) throw refuse("is in Fortran order; save it with numpy.ascontiguousarray(array)");
  if (header->shape.size() != 2 ||
      std::find(columns.begin(), columns.end(), header->shape[1]) == columns.end())
    throw refuse("has the shape " + shape_text(header->shape) + "; " + columns_text(columns) + " is wanted");
  return {header->shape[0], header->shape[1], data_at,
          header->descr == "<f8" ? sizeof(double) : sizeof(float)};
}

/// Holds the rows against the bytes that there are for them.
void check_length(const Shape& shape, std::uint64_t there, const std::string& name) {
  if (shape.rows > there / shape.row_bytes())
    throw Error(ErrorKind::kInput, name,
                "is cut: " + std::to_string(shape.rows) + " rows are announced and " +
                    std::to_string(there / shape.row_bytes()) + " whole ones are there");
  if (const std::uint64_t wanted = shape.rows * shape.row_bytes(); wanted != there)
    throw Error(ErrorKind::kInput, name,
                "has " + std::to_string(there - wanted) + " bytes too many after its " +
                    std::to_string(shape.rows) + " rows, from byte " +
                    std::to_string(shape.data_at + wanted));
}

/// How many bytes the header has, by its first twelve; 0: not to be told.
std::size_t header_bytes(std::string_view start) {
  if (start.size() < 12 || !start.starts_with(kMagic)) return 0;
  const std::size_t length_bytes = start[6] == 1 ? 2 : 4;
  return 8 + length_bytes + little_endian(start.substr(8, length_bytes));
}

}  // namespace

namespace {

/// Values as floats, less `shift` in each row's first three.
void narrow(const char* from, std::size_t value_bytes, std::size_t columns, Vec3d shift,
            std::span<float> to) {
  for (std::size_t i = 0; i < to.size(); ++i) {
    double value = 0;
    float single = 0;
    std::memcpy(value_bytes == sizeof(double) ? static_cast<void*>(&value) : &single, from + i * value_bytes,
                value_bytes);
    if (value_bytes == sizeof(float)) value = static_cast<double>(single);
    const std::size_t column = i % columns;
    if (column < 3) value -= shift[static_cast<int>(column)];
    to[i] = static_cast<float>(value);
  }
}

}  // namespace

FloatTable decode_npy(std::string_view bytes, const std::string& name, std::span<const std::size_t> columns,
                      Vec3d shift) {
  const Shape shape = parse_shape(bytes, name, columns);
  check_length(shape, bytes.size() - shape.data_at, name);
  FloatTable table;
  table.rows = static_cast<std::size_t>(shape.rows);
  table.columns = static_cast<std::size_t>(shape.columns);
  table.values.resize(table.rows * table.columns);
  narrow(bytes.data() + shape.data_at, shape.value_bytes, table.columns, shift, table.values);
  return table;
}

NpyReader::NpyReader(const std::string& path, std::span<const std::size_t> columns) : input_(path) {
  std::string start(12, '\0');
  start.resize(input_.read(std::as_writable_bytes(std::span(start))));
  if (start.empty()) throw Error(ErrorKind::kInput, input_.name(), "is empty");
  if (const std::size_t all = header_bytes(start); all > start.size()) {
    if (all > kLongestHeader)
      throw Error(ErrorKind::kInput, input_.name(),
                  "has a header of " + std::to_string(all) + " bytes, which is no array's");
    start.resize(all);
    start.resize(12 + input_.read(std::as_writable_bytes(std::span(start).subspan(12))));
  }
  const Shape shape = parse_shape(start, input_.name(), columns);
  if (const auto size = input_.file_bytes()) check_length(shape, *size - shape.data_at, input_.name());
  rows_ = shape.rows;
  columns_ = static_cast<std::size_t>(shape.columns);
  data_at_ = shape.data_at;
  value_bytes_ = shape.value_bytes;
}

std::size_t NpyReader::read(std::span<float> to, Vec3d shift) {
  const Shape shape{rows_, columns_, data_at_, value_bytes_};
  const std::uint64_t left = rows_ - bytes_read_ / shape.row_bytes();
  const auto rows = static_cast<std::size_t>(std::min<std::uint64_t>(to.size() / columns_, left));
  std::vector<char> wide(is_double() || shift != Vec3d{} ? rows * shape.row_bytes() : 0);
  const std::size_t got = input_.read(wide.empty() ? std::as_writable_bytes(to.first(rows * columns_))
                                                   : std::as_writable_bytes(std::span(wide)));
  bytes_read_ += got;
  if (got < rows * shape.row_bytes()) check_length(shape, bytes_read_, input_.name());
  std::byte more[1];
  if (rows == left && input_.read(more) > 0)
    check_length(shape, bytes_read_ + 1 + input_.skip(), input_.name());
  if (!wide.empty()) narrow(wide.data(), value_bytes_, columns_, shift, to.first(rows * columns_));
  return rows;
}

FloatTable read_npy(const std::string& path, std::span<const std::size_t> columns, Vec3d shift) {
  const InputBytes bytes = read_input(path);
  return decode_npy(bytes.view(), input_name(path), columns, shift);
}

std::vector<Vec3f> read_points(const std::string& path, Vec3d shift) {
  static constexpr std::size_t kColumns[] = {3};
  const FloatTable table = read_npy(path, kColumns, shift);
  std::vector<Vec3f> points(table.rows);
  for (std::size_t i = 0; i < table.rows; ++i)
    points[i] = {table.values[3 * i], table.values[3 * i + 1], table.values[3 * i + 2]};
  return points;
}

PointValues read_point_values(const std::string& points, const std::string& values,
                              const MemoryBudget& memory, Vec3d shift) {
  static constexpr std::size_t kColumns[] = {1, 2, 3, 4};
  for (const std::string& path : {points, values}) check_read_budget(memory, path);
  PointValues read{read_points(points, shift), read_npy(values, kColumns)};
  if (read.values.rows != read.points.size())
    throw Error(ErrorKind::kInput, values,
                "has " + std::to_string(read.values.rows) + " rows for the " +
                    std::to_string(read.points.size()) + " points of " + points);
  return read;
}

std::string npy_header(std::uint64_t rows, std::size_t columns) {
  std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (" + std::to_string(rows) + ", " +
                       std::to_string(columns) + "), }";
  const std::size_t before = kMagic.size() + 4, used = before + header.size() + 1;
  header.append((kHeaderAlignment - used % kHeaderAlignment) % kHeaderAlignment, ' ');
  header += '\n';
  std::string bytes(kMagic);
  bytes += {'\x01', '\x00', static_cast<char>(header.size() & 255), static_cast<char>(header.size() >> 8)};
  return bytes + header;
}

void write_npy(const std::string& path, std::span<const float> values, std::size_t columns, bool overwrite) {
  RBVH_CHECK(columns > 0 && values.size() % columns == 0);
  OutputFile file(path, overwrite);
  file.write(npy_header(values.size() / columns, columns));
  file.write(std::as_bytes(values));
  file.commit();
}

}  // namespace rbvh
