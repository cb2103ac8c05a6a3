// Builds a scan that is larger than memory: surveys it, cuts it into cells, builds each cell as a pair, and
// writes a table of these.
#pragma once

#include <optional>
#include <string>

#include "chunks/survey.h"
#include "pipeline/device/device.h"
#include "rbvh/build_in_chunks.h"

namespace rbvh {

/// Whether the scan is built as a whole within the budget.
bool fits_memory(const BigPly& ply, const BuildConfig& config, const MemoryBudget& memory);

/// build_in_chunks() of a scan that has been surveyed.
ChunkReport build_in_chunks(const Device& device, const ScanSurvey& survey, const std::string& output,
                            const BuildConfig& config, const ChunkConfig& chunks,
                            const Progress& progress = {});

/// Throws as build_in_chunks() does for an output that cannot be, before any work is done.
void check_chunk_output(const std::string& output, bool overwrite);

}  // namespace rbvh
