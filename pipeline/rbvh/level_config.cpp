// The parameters of levels: the paper's table 2 with an error for each, and what lies between its rows.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "pipeline/base/error.h"
#include "rbvh/build.h"

namespace rbvh {
namespace {

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

[[noreturn]] void refuse(const std::string& what) { throw Error(ErrorKind::kUsage, "", what); }

std::string nearest_name(double error) {
  const auto distance = [&](const LevelConfig& level) {
    return std::abs(std::log(error / static_cast<double>(level.error)));
  };
  const std::vector<LevelConfig>& levels = standard_levels();
  return std::min_element(levels.begin(), levels.end(),
                          [&](const auto& a, const auto& b) { return distance(a) < distance(b); })
      ->name;
}

/// One of a level that is wanted several times: they must agree.
const WantedLevel& find_wanted(const std::vector<WantedLevel>& wanted, const std::string& name) {
  const auto is_it = [&](const WantedLevel& level) { return level.name == name; };
  const auto first = std::find_if(wanted.begin(), wanted.end(), is_it);
  for (auto next = first; next != wanted.end(); ++next)
    if (is_it(*next) && next->error != first->error) refuse("level " + name + " is wanted with two errors");
  return *first;
}

}  // namespace

const std::vector<LevelConfig>& standard_levels() {
  static const std::vector<LevelConfig> levels = {{"Q0", 2e6f, 0.85f, 45, 1.6e-5f},
                                                  {"Q1", 1e6f, 0.80f, 50, 3.2e-5f},
                                                  {"Q2", 512e3f, 0.75f, 55, 5.8e-5f},
                                                  {"Q3", 128e3f, 0.70f, 60, 1.7e-4f},
                                                  {"Q4", 32e3f, 0.65f, 65, 6e-4f}};
  return levels;
}

std::vector<LevelConfig> standard_levels(const std::vector<std::string>& names) {
  if (names.empty()) return standard_levels();
  std::vector<LevelConfig> chosen;
  for (const LevelConfig& level : standard_levels())
    if (std::find(names.begin(), names.end(), level.name) != names.end()) chosen.push_back(level);
  for (const std::string& name : names)
    if (std::none_of(chosen.begin(), chosen.end(),
                     [&](const LevelConfig& level) { return level.name == name; }))
      refuse("there is no level '" + name + "'; there are Q0, Q1, Q2, Q3 and Q4");
  return chosen;
}

LevelConfig level_of_error(double error) {
  if (!(error >= kFinestError && error <= kCoarsestError))
    refuse("an error of " + number(error) + " of the scan's diagonal is not between " + number(kFinestError) +
           " and " + number(kCoarsestError));
  const auto asked = static_cast<float>(error);
  const std::vector<LevelConfig>& levels = standard_levels();
  const auto coarser = std::find_if(levels.begin(), levels.end(),
                                    [&](const LevelConfig& level) { return level.error >= asked; });
  LevelConfig own = coarser == levels.end() ? levels.back() : *coarser;
  if (coarser == levels.begin() || coarser == levels.end()) {
    own.rho = static_cast<float>(static_cast<double>(own.rho * own.error) / error);
  } else {
    const LevelConfig &fine = *(coarser - 1), &coarse = *coarser;
    const auto log_of = [](float value) { return std::log(static_cast<double>(value)); };
    const double share = (log_of(asked) - log_of(fine.error)) / (log_of(coarse.error) - log_of(fine.error));
    const auto between = [&](float a, float b) {
      return static_cast<float>(std::lerp(static_cast<double>(a), static_cast<double>(b), share));
    };
    own.rho = static_cast<float>(std::exp(std::lerp(log_of(fine.rho), log_of(coarse.rho), share)));
    own.alpha = between(fine.alpha, coarse.alpha);
    own.phi_degrees = between(fine.phi_degrees, coarse.phi_degrees);
  }
  own.error = asked;
  own.name = nearest_name(error);
  return own;
}

std::vector<LevelConfig> wanted_levels(const std::vector<WantedLevel>& wanted) {
  std::vector<std::string> names;
  names.reserve(wanted.size());
  for (const WantedLevel& level : wanted) names.push_back(level.name);
  std::vector<LevelConfig> levels = standard_levels(names);
  if (wanted.empty()) return levels;
  for (LevelConfig& level : levels) {
    const std::optional<double> error = find_wanted(wanted, level.name).error;
    if (!error) continue;
    const std::string name = level.name;
    level = level_of_error(*error);
    level.name = name;
  }
  for (std::size_t i = 1; i < levels.size(); ++i)
    if (!(levels[i].error > levels[i - 1].error))
      refuse("level " + levels[i].name + "'s error, " + number(static_cast<double>(levels[i].error)) +
             ", is not coarser than level " + levels[i - 1].name + "'s, " +
             number(static_cast<double>(levels[i - 1].error)));
  return levels;
}

std::vector<LevelConfig> by_density(std::vector<LevelConfig> levels) {
  for (LevelConfig& level : levels) level.error = 0;
  return levels;
}

}  // namespace rbvh
