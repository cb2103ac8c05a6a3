// Normals, their sides and radii of a cloud that is larger than memory, as complete_cloud() finds them: cell
// after cell, each with the points near it.
#pragma once

#include <cstdint>
#include <string>

#include "chunks/work_files.h"
#include "rbvh/build_in_chunks.h"

namespace rbvh {

struct CompletedCells {
  std::uint64_t normals = 0, radii = 0, duplicates = 0;
  std::uint32_t cells = 0;
};

/// Fills in what vertices lack, and drops points that are equal to others in all. A cell's normals take the
/// side of those near it that are known; the highest cells come first, then their neighbours. `box`: of the
/// positions.
CompletedCells complete_cells(const BigPly& vertices, const Bounds3d& box, const std::string& folder,
                              const ChunkConfig& chunks, const Progress& progress = {});

}  // namespace rbvh
