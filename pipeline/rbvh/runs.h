// Primitive references of nodes or tiles, divided into runs for a work item each: so do all kernels over
// primitives of a build share their work.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/primitives.h"

namespace rbvh {

/// Divides [begin, end) into runs of at most `run_length` references.
void append_runs(std::vector<Run>& runs, std::uint32_t owner, std::uint32_t begin, std::uint32_t end,
                 std::uint32_t run_length);

struct Runs {
  std::vector<Run> list;
  Buffer<Run> buffer;  ///< the same on the device

  std::uint32_t count() const { return static_cast<std::uint32_t>(list.size()); }
};

inline Runs upload_runs(const Device& device, std::vector<Run> list) {
  Buffer<Run> buffer(device, list);
  return {std::move(list), std::move(buffer)};
}

/// A kernel with a work item for each run, whose first arguments are the runs and their number.
template <class... Args>
void run_over(const Device& device, const Runs& runs, std::string_view file, std::string_view entry,
              const Args&... args) {
  device.kernel(file, entry).run(runs.count(), job_group_size(device), runs.buffer, runs.count(), args...);
}

}  // namespace rbvh
