#include "pipeline/base/units.h"

#include <utility>

namespace rbvh {

std::optional<double> unit_meters(std::string_view unit) {
  static constexpr std::pair<std::string_view, double> kUnits[] = {
      {"mm", 1e-3}, {"cm", 1e-2}, {"m", 1}, {"km", 1e3}, {"in", 0.0254}, {"ft", 0.3048}};
  for (const auto& [name, meters] : kUnits)
    if (name == unit) return meters;
  return std::nullopt;
}

}  // namespace rbvh
