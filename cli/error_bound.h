// How errors are written on the command line: parts of the diagonal, percent, or lengths with a unit.
#pragma once

#include <string_view>
#include <vector>

#include "pipeline/base/error_bound.h"
#include "rbvh/build.h"

namespace rbvh {

/// "0.5mm", "0.5units", "0.01%", "0.5": a number above 0. Throws Error(kUsage).
ErrorBound parse_error_bound(std::string_view text);

/// "Q0=1e-5,Q2": levels, some with errors, in parts of the diagonal. Throws Error(kUsage).
std::vector<WantedLevel> parse_wanted_levels(std::string_view text);

}  // namespace rbvh
