// Strict reading of what people write: the whole word or a usage error, the same under every locale. (CLI11's
// own delimited lists swallow the next positional and accept "0,1,,2" and "nan".)
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/base/error.h"
#include "rbvh/geometry.h"

namespace rbvh {

// All of these throw Error(kUsage) with a line that quotes `text`.

/// A finite number such as -1, 0.5 or 1e-3.
double parse_number(std::string_view text);
std::int64_t parse_integer(std::string_view text);
/// An integer of at least 1.
int parse_positive(std::string_view text);
/// An integer from `least` to `most`.
int parse_integer_between(std::string_view text, int least, int most);

/// A number above 0.
double parse_above_zero(std::string_view text);
/// A number of at least 0.
float parse_distance(std::string_view text);
/// A number from `least` to `most`.
double parse_between(std::string_view text, double least, double most);

/// One of a table's names: rows of name and value.
template <const auto& kChoices>
auto parse_choice(std::string_view text) {
  std::string names;
  for (const auto& [name, value] : kChoices) {
    if (name == text) return value;
    names.append(names.empty() ? "" : ", ").append(name);
  }
  throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is none of " + names);
}

/// "x,y,z".
Vec3d parse_vec3(std::string_view text);

struct Resolution {
  std::uint32_t width = 1024, height = 1024;
};
/// "W,H" in pixels, each 1 to 65536.
Resolution parse_resolution(std::string_view text);

/// "+Z", "-x", "Y": the unit vector along an axis.
Vec3d parse_axis(std::string_view text);

/// A number of bytes: "1500000", "64K", "1.5G", "2GiB"; units are powers of 1024.
std::uint64_t parse_bytes(std::string_view text);

/// The size of a file: as parse_bytes(), but with B after it a unit is a power of 1000, as files' sizes are
/// printed: "2MB" is two million, "2M" and "2MiB" are 2097152.
std::uint64_t parse_file_size(std::string_view text);

/// "a,b,c": one word or more, none empty.
std::vector<std::string> parse_list(std::string_view text);

}  // namespace rbvh
