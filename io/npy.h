// NumPy's .npy files: tables of C-order little-endian float32, as `rbvh trace` takes and gives them. Format:
// numpy.lib.format, versions 1.0 to 3.0.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rbvh/geometry.h"

namespace rbvh {

/// Row by row.
struct FloatTable {
  std::size_t rows = 0, columns = 0;
  std::vector<float> values;  ///< rows * columns
};

/// Reads `path` ("-": standard input), whose number of columns must be one of `columns`; zero rows are fine.
/// Hostile input is expected. Throws Error(kInput) saying what it is instead, where it ends, and how to save
/// it rightly.
FloatTable read_npy(const std::string& path, std::span<const std::size_t> columns);

/// The same from bytes in memory; `name` is for messages.
FloatTable decode_npy(std::string_view bytes, const std::string& name, std::span<const std::size_t> columns);

/// read_npy() of a table of three columns as points.
std::vector<Vec3f> read_points(const std::string& path);

/// Writes values.size() / columns rows ("-": standard output) as numpy.save would. Throws Error(kFailure).
void write_npy(const std::string& path, std::span<const float> values, std::size_t columns, bool overwrite);

}  // namespace rbvh
