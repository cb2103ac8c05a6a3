// Reads scans that are larger than memory, piece after piece.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/base/memory_budget.h"
#include "rbvh/scan.h"

namespace rbvh {

/// Some of a file's vertices, in their order, and some of its triangles, by the numbers of vertices from the
/// file's first one on. A triangle may come before its vertices, so polygons are fans.
struct ScanPiece {
  RawScan scan;
  std::vector<std::uint32_t> fans;  ///< of each triangle how many are left of its polygon's; empty: one
};
using VisitPiece = std::function<void(ScanPiece&& piece)>;

/// What is known of a file when it is read.
struct PiecesRead {
  std::vector<std::string> notes;  ///< what it has that is not kept, and what was guessed
  bool corners_apart = false;      ///< of a mesh: no two triangles share a vertex
};

/// Whether a file is of a format that is read in pieces, and has no textures as far as its begin shows.
bool can_be_in_pieces(const std::string& path);

/// LAS, STL, PLY and OBJ in bounded memory, other formats as a whole. Throws as read_scan(), Error(kBudget)
/// for a file that is read whole and does not fit, Error(kInput) for a scan with textures.
PiecesRead read_in_pieces(const std::string& path, const MemoryBudget& memory, const VisitPiece& visit);

}  // namespace rbvh
