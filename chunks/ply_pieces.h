// PLY files that are larger than memory: text, and bytes of either order.
#pragma once

#include "chunks/scan_pieces.h"
#include "io/ply_header.h"

namespace rbvh {

ply::Header ply_header(const std::string& path);

/// Whether the file is vertices of scalars, then faces, without textures; others are read as a whole.
bool is_in_pieces(const ply::Header& header);

PiecesRead read_ply_in_pieces(const std::string& path, const ply::Header& header, const VisitPiece& visit);

}  // namespace rbvh
