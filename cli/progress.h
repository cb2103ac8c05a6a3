// Shows on stderr how far a stage is: a bar on a terminal, sparse lines elsewhere, or JSON lines for
// programs.
#pragma once

#include <chrono>
#include <mutex>
#include <string>
#include <string_view>

#include "rbvh/progress.h"

namespace rbvh {

enum class ProgressMode { kAuto, kBar, kPlain, kJson, kNone };

/// One phase at a time; callable from any thread.
class ProgressReporter {
 public:
  /// kAuto becomes a bar where stderr is a terminal, plain lines elsewhere.
  void start(ProgressMode mode, std::string stage, bool color);
  /// What pipeline code is given. The reporter must outlive it.
  Progress callback();
  void update(std::string_view phase, double fraction);
  /// Ends the running phase and wipes the bar.
  void finish();
  /// Wipes the bar of a phase that failed.
  void abandon();
  /// Writes a line to stderr without tearing the bar.
  void print_line(std::string_view line);

 private:
  using Clock = std::chrono::steady_clock;
  void show(double fraction, Clock::time_point now);
  void end_phase(Clock::time_point now);
  void clear_phase();

  std::mutex mutex_;
  ProgressMode mode_ = ProgressMode::kNone;
  std::string stage_, phase_;
  bool color_ = false, bar_drawn_ = false, line_shown_ = false;
  double fraction_ = 0;
  Clock::time_point phase_start_{}, next_show_{};
};

}  // namespace rbvh
