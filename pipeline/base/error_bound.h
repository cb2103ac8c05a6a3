// How far a surface may be from another, as people state it: a number and what it is in.
#pragma once

#include <string>
#include <string_view>

namespace rbvh {

struct ErrorBound {
  double value = 0;  ///< above 0
  std::string unit;  ///< "%" of the diagonal, "units" of the scan, a unit of length; empty: the caller's own
};

/// "0.5mm", "0.5units", "0.01%", "0.5": a number above 0. Throws Error(kUsage).
ErrorBound parse_error_bound(std::string_view text);

/// What errors are measured with.
struct ErrorScale {
  double diagonal = 0;  ///< scan units
  std::string units;    ///< that the scan states; others than those of unit_meters(): not known
};

/// The error as a part of the diagonal. `unit`: of one without. Throws Error(kUsage), naming `file`, for a
/// unit of length where those of the scan are not known.
double part_of_diagonal(const ErrorBound& error, const std::string& unit, const ErrorScale& scale,
                        const std::string& file);

}  // namespace rbvh
