#include "cli/progress.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace rbvh {
namespace {

constexpr int kBarWidth = 30;
constexpr auto kBarInterval = std::chrono::milliseconds(60);
constexpr auto kJsonInterval = std::chrono::milliseconds(100);
constexpr auto kPlainQuiet = std::chrono::seconds(1);  // a phase shorter than this says nothing
constexpr auto kPlainInterval = std::chrono::seconds(5);

double seconds(std::chrono::steady_clock::duration d) { return std::chrono::duration<double>(d).count(); }

std::string json_line(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

void ProgressReporter::start(ProgressMode mode, std::string stage, bool color) {
  if (mode == ProgressMode::kAuto) mode = isatty(STDERR_FILENO) ? ProgressMode::kBar : ProgressMode::kPlain;
  mode_ = mode;
  stage_ = std::move(stage);
  color_ = color;
}

Progress ProgressReporter::callback() {
  return [this](std::string_view phase, double fraction) { update(phase, fraction); };
}

void ProgressReporter::update(std::string_view phase, double fraction) {
  if (mode_ == ProgressMode::kNone) return;
  const std::lock_guard lock(mutex_);
  const auto now = Clock::now();
  if (phase != phase_) {
    end_phase(now);
    phase_ = phase;
    phase_start_ = now;
    next_show_ = mode_ == ProgressMode::kPlain ? now + kPlainQuiet : now;
  }
  fraction_ = std::clamp(fraction, 0.0, 1.0);
  if (now >= next_show_) show(fraction_, now);
}

void ProgressReporter::show(double fraction, Clock::time_point now) {
  const int percent = static_cast<int>(fraction * 100);
  switch (mode_) {
    case ProgressMode::kBar: {
      const int filled = static_cast<int>(fraction * kBarWidth);
      const std::string bar(static_cast<std::size_t>(filled), '#');
      std::fprintf(stderr, "\r\033[K%s [%s%-*s%s] %3d%% %s", stage_.c_str(), color_ ? "\033[36m" : "",
                   kBarWidth, bar.c_str(), color_ ? "\033[0m" : "", percent, phase_.c_str());
      bar_drawn_ = true;
      next_show_ = now + kBarInterval;
      break;
    }
    case ProgressMode::kPlain:
      std::fprintf(stderr, "rbvh %s: %s %d%%\n", stage_.c_str(), phase_.c_str(), percent);
      line_shown_ = true;
      next_show_ = now + kPlainInterval;
      break;
    case ProgressMode::kJson: {
      const std::string line = json_line({{"stage", stage_},
                                          {"phase", phase_},
                                          {"fraction", fraction},
                                          {"seconds", seconds(now - phase_start_)}});
      std::fprintf(stderr, "%s\n", line.c_str());
      next_show_ = now + kJsonInterval;
      break;
    }
    default:
      break;
  }
  std::fflush(stderr);
}

void ProgressReporter::end_phase(Clock::time_point now) {
  if (phase_.empty()) return;
  if (mode_ == ProgressMode::kJson && fraction_ < 1) show(1, now);
  if (mode_ == ProgressMode::kPlain && (line_shown_ || now - phase_start_ > kPlainQuiet))
    std::fprintf(stderr, "rbvh %s: %s done, %.1f s\n", stage_.c_str(), phase_.c_str(),
                 seconds(now - phase_start_));
  clear_phase();
}

void ProgressReporter::clear_phase() {
  if (bar_drawn_) std::fputs("\r\033[K", stderr);
  std::fflush(stderr);
  bar_drawn_ = line_shown_ = false;
  fraction_ = 0;
  phase_.clear();
}

void ProgressReporter::finish() {
  const std::lock_guard lock(mutex_);
  end_phase(Clock::now());
}

void ProgressReporter::abandon() {
  const std::lock_guard lock(mutex_);
  clear_phase();
}

void ProgressReporter::print_line(std::string_view line) {
  const std::lock_guard lock(mutex_);
  if (bar_drawn_) std::fputs("\r\033[K", stderr);
  bar_drawn_ = false;
  const std::string shown =
      mode_ == ProgressMode::kJson ? json_line({{"stage", stage_}, {"line", line}}) : std::string(line);
  std::fprintf(stderr, "%s\n", shown.c_str());
  std::fflush(stderr);
}

}  // namespace rbvh
