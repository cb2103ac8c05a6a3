// Reads one cell of a scan, with what is near it, as a scan of its own.
#pragma once

#include <string>
#include <vector>

#include "chunks/cell_files.h"
#include "pipeline/rbvh/build_part.h"

namespace rbvh {

struct LoadedCell {
  Scan scan;  ///< its own vertices and primitives first
  ScanPart part;
};

/// About how many bytes a cell of so many primitives (with those near it) takes until it is built.
std::uint64_t cell_memory(const BigPly& ply, std::uint64_t primitives);

/// Of a cloud's cell, the numbers of its own points, which ascend.
std::vector<std::uint32_t> own_points(const std::string& folder, std::size_t cell);

LoadedCell load_cell(const ScanSurvey& survey, const SpaceGrid& grid, const CellPlan& plan,
                     const std::string& folder, std::size_t cell);

}  // namespace rbvh
