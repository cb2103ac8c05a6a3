#include "pipeline/base/words.h"

#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>
#include <sstream>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

[[noreturn]] void refuse(std::string_view text, const std::string& wanted) {
  throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not " + wanted);
}

// from_chars takes no leading '+', which people write.
template <class T>
bool parse_whole(std::string_view text, T& value) {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  const char* end = text.data() + text.size();
  const auto [stop, code] = std::from_chars(text.data(), end, value);
  return !text.empty() && code == std::errc() && stop == end;
}

std::vector<std::string_view> split(std::string_view text) {
  std::vector<std::string_view> words;
  for (;;) {
    const std::size_t comma = text.find(',');
    words.push_back(text.substr(0, comma));
    if (comma == std::string_view::npos) return words;
    text.remove_prefix(comma + 1);
  }
}

bool finite_number(std::string_view text, double& value) {
  return parse_whole(text, value) && std::isfinite(value);
}

}  // namespace

double parse_number(std::string_view text) {
  double value = 0;
  if (!finite_number(text, value)) refuse(text, "a number");
  return value;
}

std::int64_t parse_integer(std::string_view text) {
  std::int64_t value = 0;
  if (!parse_whole(text, value)) refuse(text, "a whole number");
  return value;
}

int parse_positive(std::string_view text) {
  int value = 0;
  if (!parse_whole(text, value) || value < 1) refuse(text, "a whole number of at least 1");
  return value;
}

int parse_integer_between(std::string_view text, int least, int most) {
  int value = 0;
  if (!parse_whole(text, value) || value < least || value > most)
    refuse(text, "a whole number from " + std::to_string(least) + " to " + std::to_string(most));
  return value;
}

double parse_above_zero(std::string_view text) {
  const double value = parse_number(text);
  if (!(value > 0)) refuse(text, "above 0");
  return value;
}

float parse_distance(std::string_view text) {
  const auto value = static_cast<float>(parse_number(text));
  if (!(value >= 0)) refuse(text, "a distance of at least 0");
  return value;
}

double parse_between(std::string_view text, double least, double most) {
  const double value = parse_number(text);
  if (!(value >= least && value <= most)) {
    std::ostringstream range;
    range << "between " << least << " and " << most;
    refuse(text, range.str());
  }
  return value;
}

Vec3d parse_vec3(std::string_view text) {
  const auto words = split(text);
  Vec3d v;
  if (words.size() != 3 || !finite_number(words[0], v.x) || !finite_number(words[1], v.y) ||
      !finite_number(words[2], v.z))
    refuse(text, "three numbers x,y,z");
  return v;
}

Resolution parse_resolution(std::string_view text) {
  constexpr std::uint32_t kMost = 65536;
  const auto words = split(text);
  Resolution r;
  if (words.size() != 2 || !parse_whole(words[0], r.width) || !parse_whole(words[1], r.height) ||
      r.width < 1 || r.height < 1 || r.width > kMost || r.height > kMost)
    refuse(text, "a resolution W,H with 1 to 65536 pixels each");
  return r;
}

Vec3d parse_axis(std::string_view text) {
  std::string_view axis = text;
  double sign = 1;
  if (!axis.empty() && (axis[0] == '+' || axis[0] == '-')) {
    sign = axis[0] == '-' ? -1 : 1;
    axis.remove_prefix(1);
  }
  const char letter = axis.size() == 1 ? axis[0] : ' ';
  if (letter == 'x' || letter == 'X') return {sign, 0, 0};
  if (letter == 'y' || letter == 'Y') return {0, sign, 0};
  if (letter == 'z' || letter == 'Z') return {0, 0, sign};
  refuse(text, "an axis (+X, -X, +Y, -Y, +Z or -Z)");
}

namespace {

std::uint64_t parse_size(std::string_view text, bool decimal_with_b) {
  static const std::string wanted = "a size in bytes such as 1500000, 64K, 1.5G or 2GiB";
  std::string_view number = text;
  const bool has_b = !number.empty() && (number.back() == 'B' || number.back() == 'b');
  if (has_b) number.remove_suffix(1);
  const bool binary = number.size() > 1 && number.back() == 'i';
  if (binary) number.remove_suffix(1);
  double scale = 1;
  if (!number.empty()) {
    const std::size_t unit = std::string_view("KMGT").find(
        static_cast<char>(std::toupper(static_cast<unsigned char>(number.back()))));
    if (unit != std::string_view::npos) {
      scale = std::pow(has_b && !binary && decimal_with_b ? 1000.0 : 1024.0, static_cast<double>(unit + 1));
      number.remove_suffix(1);
    } else if (binary) {
      refuse(text, wanted);
    }
  }
  double value = 0;
  if (!finite_number(number, value) || value <= 0 || value * scale < 1 || value * scale > 0x1p62)
    refuse(text, wanted);
  return static_cast<std::uint64_t>(value * scale);
}

}  // namespace

std::uint64_t parse_bytes(std::string_view text) { return parse_size(text, false); }
std::uint64_t parse_file_size(std::string_view text) { return parse_size(text, true); }

std::vector<std::string> parse_list(std::string_view text) {
  std::vector<std::string> list;
  for (const std::string_view word : split(text)) {
    if (word.empty()) refuse(text, "a list of words with commas between them");
    list.emplace_back(word);
  }
  return list;
}

}  // namespace rbvh
