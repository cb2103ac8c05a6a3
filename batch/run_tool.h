// Runs the tool itself as a process of its own, so that one scan's failure, memory or crash is not another's.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace rbvh {

struct ToolResult {
  int code = 0;  ///< exit code; 128 + N where signal N ended it
  double seconds = 0;
  std::uint64_t peak_bytes = 0;  ///< resident
};

/// Runs this program with `words`. Standard input is empty; both files are made anew. It ends with the thread
/// that calls this. Throws Error(kFailure) where a file cannot be made or no process started.
ToolResult run_tool(const std::vector<std::string>& words, const std::string& stdout_path,
                    const std::string& stderr_path);

}  // namespace rbvh
