#include "pipeline/base/error_bound.h"

#include <charconv>
#include <cmath>
#include <optional>

#include "pipeline/base/error.h"
#include "pipeline/base/units.h"

namespace rbvh {

ErrorBound parse_error_bound(std::string_view text) {
  ErrorBound error;
  const char* const end = text.data() + text.size();
  const auto [stop, code] = std::from_chars(text.data(), end, error.value);
  if (code == std::errc()) error.unit.assign(stop, end);
  const bool is_unit =
      error.unit.empty() || error.unit == "%" || error.unit == "units" || unit_meters(error.unit);
  if (code != std::errc() || !is_unit || !std::isfinite(error.value) || !(error.value > 0))
    throw Error(ErrorKind::kUsage, "",
                "'" + std::string(text) + "' is not a number above 0, alone or with %, units, " +
                    std::string(kUnitNames) + " behind it");
  return error;
}

double part_of_diagonal(const ErrorBound& error, const std::string& unit, const ErrorScale& scale,
                        const std::string& file) {
  const std::string& own = error.unit.empty() ? unit : error.unit;
  if (own == "%") return error.value / 100;
  if (own == "units") return error.value / scale.diagonal;
  const std::optional<double> meters = unit_meters(own), scan_meters = unit_meters(scale.units);
  if (!scan_meters)
    throw Error(ErrorKind::kUsage, file, "its units are not known, so an error in " + own + " says nothing",
                Remedy::kScanUnits);
  return error.value * *meters / *scan_meters / scale.diagonal;
}

}  // namespace rbvh
