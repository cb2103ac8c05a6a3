// Builds a scan that is larger than memory: surveys it, cuts it into cells, builds each cell as a pair, and
// writes a table of these.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "chunks/chunk_folder.h"
#include "chunks/gather_scan.h"
#include "chunks/survey.h"
#include "pipeline/device/device.h"
#include "rbvh/build_in_chunks.h"

namespace rbvh {

/// Whether scans are built as a whole within the budget.
bool fits_memory(const std::vector<std::string>& inputs, const BuildConfig& config,
                 const MemoryBudget& memory);

/// A scan as builds in chunks read it.
struct ChunkSource {
  BigPly ply;
  std::vector<std::string> notes;       ///< GatheredScan's
  std::shared_ptr<ChunkFolder> folder;  ///< where it was gathered, beside the output; goes with this
};

/// The input, where it is such a file, else what is gathered of the inputs. Throws as gather_scan() and
/// check_chunk_output() do.
ChunkSource open_chunk_source(const std::vector<std::string>& inputs, const std::string& output,
                              const ChunkConfig& chunks, const Progress& progress = {});

/// build_in_chunks() of a scan that has been surveyed.
ChunkReport build_in_chunks(const Device& device, const ScanSurvey& survey, const std::string& output,
                            const BuildConfig& config, const ChunkConfig& chunks,
                            const Progress& progress = {});

/// Throws as build_in_chunks() does for an output that cannot be, before any work is done.
void check_chunk_output(const std::string& output, bool overwrite);

}  // namespace rbvh
