// Wall-clock time, for reports.
#pragma once

#include <chrono>
#include <utility>

namespace rbvh {

/// Seconds since it was made, or since its last lap().
class Stopwatch {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    return std::chrono::duration<double>(now - std::exchange(last_, now)).count();
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace rbvh
