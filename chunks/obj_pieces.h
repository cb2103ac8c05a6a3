// OBJ files that are larger than memory.
#pragma once

#include "chunks/scan_pieces.h"

namespace rbvh {

/// Positions and faces, each `o` and `g` an object of its own.
PiecesRead read_obj_in_pieces(const std::string& path, const VisitPiece& visit);

}  // namespace rbvh
