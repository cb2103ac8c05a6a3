#include "cli/layer_options.h"

#include <algorithm>
#include <cmath>

namespace rbvh {
namespace {

constexpr std::size_t kPointColumns[] = {3};

}  // namespace

double parse_layer_scale(std::string_view text) {
  const double scale = parse_number(text);
  if (!(scale >= 1.0 / 16 && scale <= 16))
    throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not between 0.0625 and 16");
  return scale;
}

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

std::vector<Vec3f> read_points(const Context& context, const std::string& path) {
  check_read_budget(context.memory, path);
  const FloatTable table = read_npy(path, kPointColumns);
  std::vector<Vec3f> points(table.rows);
  for (std::size_t i = 0; i < table.rows; ++i)
    points[i] = {table.values[3 * i], table.values[3 * i + 1], table.values[3 * i + 2]};
  return points;
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

float surface_reach(const Rbvh& rbvh, const std::optional<float>& given) {
  return given.value_or(0.01f * rbvh.source.bounds.diagonal());
}

}  // namespace rbvh
