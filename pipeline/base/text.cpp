#include "pipeline/base/text.h"

#include <cstdio>
#include <string_view>

namespace rbvh {

std::string format_bytes(std::uint64_t bytes) {
  static const char* const kUnits[] = {"B", "kB", "MB", "GB", "TB"};
  double value = static_cast<double>(bytes);
  int unit = 0;
  while (value >= 999.5 && unit < 4) {
    value /= 1000;
    ++unit;
  }
  char text[32];
  std::snprintf(text, sizeof text, unit == 0 ? "%.0f %s" : "%.3g %s", value, kUnits[unit]);
  return text;
}

std::string plural(const std::string& noun) {
  const auto ends = [&](std::string_view end) { return noun.ends_with(end); };
  if (ends("leaf")) return noun.substr(0, noun.size() - 1) + "ves";
  if (ends("vertex")) return noun.substr(0, noun.size() - 2) + "ices";
  if (ends("radius")) return noun.substr(0, noun.size() - 2) + "i";
  if (ends("patch")) return noun + "es";
  return noun + "s";
}

std::string counted(std::uint64_t count, const std::string& noun) {
  return std::to_string(count) + " " + (count == 1 ? noun : plural(noun));
}

std::string one_line(std::string text) {
  for (char& c : text)
    if (c == '\n' || c == '\r') c = ' ';
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

}  // namespace rbvh
