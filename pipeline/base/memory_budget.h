// How much memory work may take: checked by estimate before it begins.
#pragma once

#include <cstdint>
#include <string>

namespace rbvh {

struct MemoryBudget {
  std::uint64_t bytes = 0;  ///< 0: what the machine has
};

/// Throws Error(kBudget) when `bytes` for `what` ("reading it") of `file` is over the budget.
void check_budget(const MemoryBudget& budget, std::uint64_t bytes, const std::string& file,
                  const std::string& what);

/// The same for reading a file as it is and what is made of its bytes, `times` their size; nothing where it
/// has no size (a pipe).
void check_read_budget(const MemoryBudget& budget, const std::string& path, std::uint64_t times = 2);

}  // namespace rbvh
