// Scans that are larger than memory: built chunk by chunk, as a pair of parts.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rbvh/build.h"
#include "rbvh/memory_budget.h"

#pragma GCC visibility push(default)
namespace rbvh {

struct ChunkConfig {
  MemoryBudget memory{};     ///< of the process: how many chunks there are follows from it
  std::uint32_t chunks = 0;  ///< so many instead; 0: as many as memory asks for
  bool resume = false;       ///< go on from what a killed build of the same scan and options has left
  bool overwrite = false;
};

struct ChunkReport {
  std::uint32_t chunks = 0, resumed = 0;  ///< resumed: of these, found built
  std::uint64_t vertices = 0, triangles = 0;
  std::uint64_t scan_bytes = 0, bytes = 0;  ///< bytes: of all files of the result
  struct Level {
    std::string name;
    std::uint64_t leaves = 0, bytes = 0;
    float error = 0, reached = 0;  ///< of the scan's diagonal
  };
  std::vector<Level> levels;
  std::vector<std::string> notes;  ///< what was left out of the inputs, guessed and completed, a line each
};

/// Builds scans that are larger than memory, chunk by chunk, several as one. A binary little-endian PLY of
/// triangles, or of points with normals and radii, is read as it is. All else is gathered as such a file
/// first, beside the output: several scans, each an object of its own, and LAS, STL, PLY and OBJ in bounded
/// memory, other formats each as a whole; normals and radii of points are completed. The output, NAME.rbvh,
/// is a table of parts, pairs in a folder beside it, and loads as one asset (load_asset()). It depends on the
/// number of chunks, and on nothing else of the machine. Killed at any moment, it leaves the old output as it
/// was. Throws Error(kUsage) for a focus, Error(kInput), Error(kBudget) where a chunk does not fit,
/// Error(kFailure) where there is no room on the disk.
ChunkReport build_in_chunks(const Device& device, const std::vector<std::string>& scans,
                            const std::string& output, const BuildConfig& config = {},
                            const ChunkConfig& chunks = {}, const Progress& progress = {});

}  // namespace rbvh
#pragma GCC visibility pop
