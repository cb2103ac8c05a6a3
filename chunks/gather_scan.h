// Any scans, as the one binary PLY that builds in chunks read: one frame for all, and clouds with normals and
// radii. In bounded memory.
#pragma once

#include <string>
#include <vector>

#include "chunks/big_ply.h"
#include "rbvh/build_in_chunks.h"

namespace rbvh {

struct GatheredScan {
  BigPly ply;
  std::vector<std::string> notes;  ///< what was left out, guessed or completed
};

/// Whether a file is such a PLY as it is.
bool is_gathered(const BigPly& ply);

/// About the vertices and primitives that files have, by their headers or sizes; 0 for those that are not
/// read in pieces.
struct ScanSize {
  std::uint64_t bytes = 0, vertices = 0, primitives = 0;
};
ScanSize estimate_size(const std::vector<std::string>& inputs);

/// Writes FOLDER/scan.ply, or takes what is there. Each input is an object of its own where there are
/// several. Throws Error(kInput) also for meshes and clouds together, and for different units;
/// Error(kBudget), Error(kFailure).
GatheredScan gather_scan(const std::vector<std::string>& inputs, const std::string& folder,
                         const ChunkConfig& chunks, const Progress& progress = {});

}  // namespace rbvh
