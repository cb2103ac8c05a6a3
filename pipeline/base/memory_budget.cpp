#include "pipeline/base/memory_budget.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

#include "pipeline/base/error.h"
#include "pipeline/base/text.h"

namespace rbvh {
namespace {

constexpr std::uint64_t kNoLimit = std::numeric_limits<std::uint64_t>::max();

// What a file of a control group allows; "max", or no such file: no limit.
std::uint64_t limit_in(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::uint64_t bytes = kNoLimit;
  return in >> bytes ? bytes : kNoLimit;
}

// Of the group and of all that it is in: batch systems and containers kill what takes more.
std::uint64_t group_limit(const std::filesystem::path& root, std::filesystem::path group, const char* file) {
  std::uint64_t bytes = limit_in(root / file);
  for (; group.has_relative_path(); group = group.parent_path())
    bytes = std::min(bytes, limit_in(root / group.relative_path() / file));
  return bytes;
}

// Lines of /proc/self/cgroup: "0::/GROUP" (version 2), "4:memory:/GROUP" (version 1).
std::uint64_t control_group_limit() {
  std::ifstream groups("/proc/self/cgroup");
  std::uint64_t bytes = kNoLimit;
  for (std::string line; std::getline(groups, line);) {
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string kinds = "," + line.substr(first + 1, second - first - 1) + ",";
    const std::string group = line.substr(second + 1);
    if (kinds == ",,") bytes = std::min(bytes, group_limit("/sys/fs/cgroup", group, "memory.max"));
    if (kinds.find(",memory,") != std::string::npos)
      bytes = std::min(bytes, group_limit("/sys/fs/cgroup/memory", group, "memory.limit_in_bytes"));
  }
  return bytes;
}

std::uint64_t machine_memory() {
  const long pages = sysconf(_SC_PHYS_PAGES), size = sysconf(_SC_PAGE_SIZE);
  if (pages <= 0 || size <= 0) return control_group_limit();
  return std::min(static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(size),
                  control_group_limit());
}

}  // namespace

std::uint64_t memory_limit(const MemoryBudget& budget) {
  return budget.bytes > 0 ? budget.bytes : machine_memory();
}

void check_budget(const MemoryBudget& budget, std::uint64_t bytes, const std::string& file,
                  const std::string& what) {
  const bool is_given = budget.bytes > 0;
  const std::uint64_t most = memory_limit(budget);
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
