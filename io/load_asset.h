// Reads the parts of load_asset() by themselves.
#pragma once

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

/// The scan that `pair` is to be measured against, in the pair's coordinates.
Asset load_reference(const std::string& path, const Rbvh& pair, const MemoryBudget& memory = {},
                     const Progress& progress = {});

}  // namespace rbvh
