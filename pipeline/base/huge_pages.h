// Large blocks of memory in pages of 2 MB.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>

namespace rbvh {

struct FreeMemory {
  void operator()(void* memory) const { std::free(memory); }
};
using HugePages = std::unique_ptr<void, FreeMemory>;

/// `bytes` of memory, not set, in pages of 2 MB where the system has them to give, else in its usual ones.
/// Null where there is none.
HugePages allocate_huge_pages(std::size_t bytes);

}  // namespace rbvh
