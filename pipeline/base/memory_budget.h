// Checks of the memory budget.
#pragma once

#include <string>

#include "rbvh/memory_budget.h"

namespace rbvh {

/// Bytes that work may take: the budget, else what the machine has and the process's control group allows.
std::uint64_t memory_limit(const MemoryBudget& budget);

/// Throws Error(kBudget) when `bytes` for `what` ("reading it") of `file` is over the budget.
void check_budget(const MemoryBudget& budget, std::uint64_t bytes, const std::string& file,
                  const std::string& what);

/// The same for reading a file as it is and what is made of its bytes, `times` their size; nothing where it
/// has no size (a pipe).
void check_read_budget(const MemoryBudget& budget, const std::string& path, std::uint64_t times = 2);

}  // namespace rbvh
