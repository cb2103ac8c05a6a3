// A chain of stages over many scans: what is up to date is left alone, what fails is named, the rest is done.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "batch/chain.h"
#include "batch/find_scans.h"
#include "batch/journal.h"
#include "rbvh/error.h"

namespace rbvh {

struct BatchConfig {
  std::string output;        ///< an existing folder
  bool force = false;        ///< replace files that the batch has not made
  int jobs = 1;              ///< scans at once
  int threads = 1;           ///< of all of them together
  std::uint64_t memory = 0;  ///< bytes, of all of them together
  std::string device;        ///< as the tool takes it; empty: its default
};

struct ScanResult {
  BatchScan scan;
  enum class State { kDone, kUpToDate, kFailed } state = State::kDone;
  std::optional<Error> error;  ///< why it failed
  std::string failed_step;     ///< empty: before any
  int exit_code = 0;           ///< of that step's process
  double seconds = 0;          ///< of the steps that were run now
  Journal journal;             ///< with the steps that stand
};

/// Throws Error(kUsage) where two outputs in `folder` would be one file, as of the scans "a" and "a-lod" with
/// an output "{name}-lod.rbvh", or one would be a scan.
void check_outputs_differ(const Chain& chain, const std::vector<BatchScan>& scans, const std::string& folder);

/// Runs the chain over each scan, `jobs` at once with equal parts of threads and memory. A step that needs
/// more memory (exit code 5) runs again alone, with all of it, once the others are done. `on_done` is called
/// by one thread at a time. The order of results is that of the scans.
std::vector<ScanResult> run_batch(const Chain& chain, const std::vector<BatchScan>& scans,
                                  const BatchConfig& config,
                                  const std::function<void(const ScanResult&, std::size_t done)>& on_done);

}  // namespace rbvh
