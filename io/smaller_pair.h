// A smaller pair of a pair: the levels that were asked for by name, by error or by bytes, derived and
// measured where they have to be.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/rbvh_file.h"
#include "pipeline/base/error_bound.h"
#include "pipeline/base/memory_budget.h"
#include "pipeline/device/device.h"
#include "rbvh/asset.h"
#include "rbvh/measure.h"

namespace rbvh {

struct LodConfig {
  std::vector<std::string> levels, dropped;  ///< as choose_levels_by_name() takes them
  std::optional<ErrorBound> most_error;      ///< one level, the smallest within; a number alone is in %
  std::optional<std::uint64_t> most_bytes;   ///< of both files
  /// A scan's file: levels that have not been measured are, and keep what is found. Empty: none.
  std::string against;
  ViewsConfig views;  ///< to measure in
  MemoryBudget memory;
  bool overwrite = false;
};

/// What is told, and asked for, on the way; all but the device may be empty.
struct LodObserver {
  std::function<Device()> open_device;  ///< where a level is derived or measured, once
  Progress progress;
  std::function<void(const std::string& line)> on_note;
  std::function<void(std::string_view phase, double seconds)> on_phase;  ///< has ended
};

struct LodReport {
  RbvhBytes bytes;
  /// The level that was chosen by an error that nobody measured: what it was built for, or what build sampled
  /// where that is larger. Else empty.
  std::string unmeasured;
};

/// Writes NAME.rbvh and its atlas, and leaves `pair` with the levels that these have. Bytes alone may ask for
/// levels coarser than any that is there: they are derived. Throws as choose_levels_by_name(),
/// choose_level_by_error() and write_rbvh_within(); Error(kInput) where `against` is another scan.
LodReport write_smaller_pair(Asset& pair, const std::string& output, const LodConfig& config,
                             const LodObserver& observer);

}  // namespace rbvh
