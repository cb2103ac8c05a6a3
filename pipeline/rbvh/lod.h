// Fewer or coarser levels of a pair: chosen by name, by error or by bytes, or built from a finer level's
// surface where the scan is not at hand.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "pipeline/device/device.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/rbvh.h"
#include "rbvh/progress.h"

namespace rbvh {

/// Builds levels from the surface of `from`, as build_rbvh() does from a scan. (Mip levels of its tiles would
/// leave a coarse level with the fine one's many leaves: section 3.5 of the paper prefers a rebuild.)
/// They are marked as derived, are not measured, and have the user's layers too; of its objects see
/// keeps_objects().
std::vector<Level> derive_levels(const Device& device, const Rbvh& rbvh, const Level& from,
                                 const std::vector<LevelConfig>& levels, const Progress& progress = {});

/// The standard levels that the pair does not have and that are coarser than `than`.
std::vector<LevelConfig> derivable_levels(const Rbvh& rbvh, const Level& than);

/// derive_levels(), added to the pair's own: finest first.
void add_derived_levels(const Device& device, Rbvh& rbvh, const Level& from,
                        const std::vector<LevelConfig>& levels, const Progress& progress = {});

/// The levels that a smaller pair has.
struct LevelChoice {
  std::vector<std::string> names;    ///< all of them
  std::vector<LevelConfig> derived;  ///< those of them that are to be derived from the pair's finest
};

/// `wanted`: the levels to keep or to derive; empty: all that are there. `dropped`: those to leave out.
/// Throws Error(kUsage) for a level that is neither there nor derivable, and where none is left; `file` is
/// for messages.
LevelChoice choose_levels_by_name(const Rbvh& rbvh, const std::vector<std::string>& wanted,
                                  const std::vector<std::string>& dropped, const std::string& file);

/// "Q0, Q2".
std::string level_names(const Rbvh& rbvh);

/// Leaves the pair with these levels alone.
void keep_levels(Rbvh& rbvh, const std::vector<std::string>& names);

/// The names of the levels that have no error_percent().
std::vector<std::string> unmeasured_levels(const Rbvh& rbvh);

/// A level's error as far as it is known, in % of the diagonal.
struct KnownError {
  double percent = 0;        ///< NaN: not known
  bool is_measured = false;  ///< error_percent(); else what it was built for
};

/// What was reached where it was measured, else the larger of what was asked for and what build sampled. A
/// cloud's levels, those by density, and what is derived from such, are known by measures alone: no error
/// shaped them.
KnownError known_error(const Rbvh& rbvh, const Level& level);

/// The coarsest level whose known_error() is at most `most` percent of the diagonal. Throws Error(kInput)
/// where one is not known, Error(kBudget) where none is within; `file` is for messages.
const Level& choose_level_by_error(const Rbvh& rbvh, double most, const std::string& file);

/// The finest set that fits, greedily: from the front, each level that still fits beside those already
/// chosen. `bytes` of each, finest first; the indices are in that order.
std::vector<std::size_t> choose_levels_by_bytes(std::span<const std::uint64_t> bytes, std::uint64_t most);

}  // namespace rbvh
