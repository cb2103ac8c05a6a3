#include "pipeline/rbvh/runs.h"

#include <algorithm>

namespace rbvh {

void append_runs(std::vector<Run>& runs, std::uint32_t owner, std::uint32_t begin, std::uint32_t end,
                 std::uint32_t run_length) {
  for (std::uint32_t at = begin; at < end; at += std::min(run_length, end - at))
    runs.push_back({owner, at, at + std::min(run_length, end - at)});
}

}  // namespace rbvh
