// NumPy's .npy files: tables of C-order little-endian float32, as `rbvh trace` takes and gives them; it takes
// float64, too. Format:
// numpy.lib.format, versions 1.0 to 3.0.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/input_file.h"
#include "rbvh/geometry.h"
#include "rbvh/memory_budget.h"

namespace rbvh {

/// Row by row.
struct FloatTable {
  std::size_t rows = 0, columns = 0;
  std::vector<float> values;  ///< rows * columns
};

/// Reads `path` ("-": standard input), whose number of columns must be one of `columns`; zero rows are fine.
/// Hostile input is expected. Throws Error(kInput) saying what it is instead, where it ends, and how to save
/// it rightly.
FloatTable read_npy(const std::string& path, std::span<const std::size_t> columns, Vec3d shift = {});

/// The same from bytes in memory; `name` is for messages. Float64 is narrowed, after `shift` was subtracted
/// from the first three columns.
FloatTable decode_npy(std::string_view bytes, const std::string& name, std::span<const std::size_t> columns,
                      Vec3d shift = {});

/// read_npy() piece by piece. Throws as it does; a file's length is checked at once, a stream's at its end.
class NpyReader {
 public:
  NpyReader(const std::string& path, std::span<const std::size_t> columns);

  std::uint64_t rows() const { return rows_; }
  std::size_t columns() const { return columns_; }
  bool is_double() const { return value_bytes_ == sizeof(double); }
  /// The next rows, as many as `to` holds or there are, less `shift` in the first three columns; their
  /// number.
  std::size_t read(std::span<float> to, Vec3d shift = {});
  void stop() { input_.stop(); }  ///< as InputStream's

 private:
  InputStream input_;
  std::uint64_t rows_ = 0, bytes_read_ = 0;
  std::size_t columns_ = 0, data_at_ = 0, value_bytes_ = sizeof(float);
};

/// read_npy() of a table of three columns as points, less `shift`.
std::vector<Vec3f> read_points(const std::string& path, Vec3d shift = {});

/// Points, and a row of values for each.
struct PointValues {
  std::vector<Vec3f> points;
  FloatTable values;
};

/// Reads both, the values of 1 to 4 columns. Throws as read_npy(), Error(kInput) where the rows are not as
/// many as the points, Error(kBudget).
PointValues read_point_values(const std::string& points, const std::string& values,
                              const MemoryBudget& memory, Vec3d shift = {});

/// What a file of so many rows begins with.
std::string npy_header(std::uint64_t rows, std::size_t columns);

/// Writes values.size() / columns rows ("-": standard output) as numpy.save would. Throws Error(kFailure).
void write_npy(const std::string& path, std::span<const float> values, std::size_t columns, bool overwrite);

}  // namespace rbvh
