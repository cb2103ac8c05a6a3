#include "pipeline/base/error_bound.h"

#include <optional>

#include "pipeline/base/error.h"
#include "pipeline/base/units.h"

namespace rbvh {

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
