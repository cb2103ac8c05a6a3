#include "cli/layer_options.h"

#include <algorithm>
#include <cmath>

namespace rbvh {

double parse_layer_scale(std::string_view text) { return parse_between(text, 1.0 / 16, 16); }

std::string parse_layer_name(std::string_view text) {
  const auto is_part = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  };
  if (text.empty() || text.size() > 32 || !std::all_of(text.begin(), text.end(), is_part))
    throw Error(ErrorKind::kUsage, "",
                "'" + std::string(text) + "' is no layer's name: 1 to 32 letters, digits, _ and -");
  return std::string(text);
}

std::vector<std::string> parse_layer_names(std::string_view text) {
  std::vector<std::string> names = parse_list(text);
  for (const std::string& name : names) parse_layer_name(name);
  return names;
}

float parse_distance(std::string_view text) {
  const auto value = static_cast<float>(parse_number(text));
  if (!(value >= 0)) throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is below 0");
  return value;
}

void warn_of_infinite(Context& context, const std::string& file, std::span<const float> values) {
  const auto infinite = std::count_if(values.begin(), values.end(), [](float v) { return std::isinf(v); });
  if (infinite > 0)
    warn(context, file + ": " + counted(static_cast<std::uint64_t>(infinite), "infinite value") +
                      ", taken for none (as nan is)");
}

void warn_of_infinite(Context& context, const std::string& file, const Scan& scan,
                      const std::string& property) {
  for (const ScalarProperty& each : scan.properties)
    if (each.name == property) warn_of_infinite(context, file, each.values);
}

}  // namespace rbvh
