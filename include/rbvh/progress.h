// How long-running code tells its caller how far it is, and how a caller asks it to stop.
#pragma once

#include <cstdint>
#include <functional>
#include <string_view>

#pragma GCC visibility push(default)
namespace rbvh {

/// Called with a phase's name and the fraction done in [0, 1]. May throw to stop the
/// work. An empty function is fine: use report().
using Progress = std::function<void(std::string_view phase, double fraction)>;

inline void report(const Progress& progress, std::string_view phase, double fraction) {
  if (progress) progress(phase, fraction);
}

}  // namespace rbvh
#pragma GCC visibility pop
