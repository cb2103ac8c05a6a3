// How much memory work may take: checked by estimate before it begins.
#pragma once

#include <cstdint>

#pragma GCC visibility push(default)
namespace rbvh {

struct MemoryBudget {
  std::uint64_t bytes = 0;  ///< 0: what the machine has
};

}  // namespace rbvh
#pragma GCC visibility pop
