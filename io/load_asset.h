// Reads the parts of load_asset() by themselves.
#pragma once

#include <optional>
#include <string>

#include "io/rbvh_file.h"
#include "pipeline/base/memory_budget.h"
#include "rbvh/io.h"
#include "rbvh/progress.h"

namespace rbvh {

/// True for a file that starts as an .rbvh does, or is named as one.
bool is_rbvh(const std::string& path);

/// Reads a pair, its texels once it is known that there is memory for them.
Rbvh load_pair(const std::string& path, const MemoryBudget& memory = {}, PairHeader* header = nullptr,
               const LevelFilter& choose = {});

/// The coarsest level of a pair of parts, of which all parts are read soon; nothing for other assets.
std::optional<Asset> load_coarsest(const Asset& asset, const MemoryBudget& memory = {});

/// The scan that `pair` is to be measured against, in the pair's coordinates.
Asset load_reference(const std::string& path, const Rbvh& pair, const MemoryBudget& memory = {},
                     const Progress& progress = {});

}  // namespace rbvh
