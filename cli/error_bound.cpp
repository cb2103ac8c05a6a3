#include "cli/error_bound.h"

#include <charconv>
#include <cmath>

#include "cli/parse.h"
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

std::vector<WantedLevel> parse_wanted_levels(std::string_view text) {
  std::vector<WantedLevel> levels;
  for (const std::string& word : parse_list(text)) {
    const std::size_t equals = word.find('=');
    WantedLevel& level = levels.emplace_back(WantedLevel{word.substr(0, equals), {}});
    if (equals != std::string::npos) level.error = parse_above_zero(word.substr(equals + 1));
  }
  return levels;
}

}  // namespace rbvh
