// Sorts a scan's primitives into the files of its cells: a pass over the scan that writes, for each cell, its
// own primitives and those of others near it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "chunks/split_cells.h"
#include "chunks/survey.h"
#include "rbvh/progress.h"

namespace rbvh {

/// A primitive in a cell's file: by the vertices of the whole scan.
struct CellRecord {
  Triangle corners{};
  std::int32_t object_id = 0;
  std::uint32_t is_own = 0;  ///< 1: the cell's own; 0: near it
};

struct CellCounts {
  std::uint64_t own = 0, near = 0;
  double area = 0;  ///< of its own, as ScanMap's
};

/// FOLDER/cell-0007.records: CellRecords, in the order of the scan.
std::string cell_path(const std::string& folder, std::size_t cell);

struct CellPlan {
  std::vector<Cell> cells;
  std::vector<std::uint16_t> cell_of_box;
  float margin =
      0;  ///< a primitive of others is near a cell where their boxes are no further apart; scan units
};

/// Throws Error(kFailure) where a file cannot be written.
std::vector<CellCounts> write_cells(const ScanSurvey& survey, const ScanMap& map, const CellPlan& plan,
                                    const std::string& folder, std::uint64_t cache_bytes,
                                    const Progress& progress = {});

}  // namespace rbvh
