#include "pipeline/base/memory_budget.h"

#include <unistd.h>

#include <filesystem>
#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/base/text.h"

namespace rbvh {
namespace {

std::uint64_t machine_memory() {
  const long pages = sysconf(_SC_PHYS_PAGES), size = sysconf(_SC_PAGE_SIZE);
  if (pages <= 0 || size <= 0) return std::numeric_limits<std::uint64_t>::max();
  return static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(size);
}

}  // namespace

void check_budget(const MemoryBudget& budget, std::uint64_t bytes, const std::string& file,
                  const std::string& what) {
  const bool is_given = budget.bytes > 0;
  const std::uint64_t most = is_given ? budget.bytes : machine_memory();
  if (bytes <= most) return;
  const std::string needs = what + " needs about " + format_bytes(bytes) + ", over the " + format_bytes(most);
  if (is_given) throw Error(ErrorKind::kBudget, file, needs + " allowed", Remedy::kMemoryBudget);
  throw Error(ErrorKind::kBudget, file, needs + " of this machine; ask for less");
}

void check_read_budget(const MemoryBudget& budget, const std::string& path, std::uint64_t times) {
  std::error_code no_size;
  const std::uintmax_t size = std::filesystem::file_size(path, no_size);
  if (!no_size) check_budget(budget, size * times, path, "reading it");
}

}  // namespace rbvh
