// Units of length that a scan may state.
#pragma once

#include <optional>
#include <string_view>

namespace rbvh {

/// As messages list them.
inline constexpr std::string_view kUnitNames = "mm, cm, m, km, in or ft";

/// How many metres one of them is; nothing for any other word.
std::optional<double> unit_meters(std::string_view unit);

}  // namespace rbvh
