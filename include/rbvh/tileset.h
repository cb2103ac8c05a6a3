// A pair as a tileset, which web viewers of large scenes stream (3D Tiles 1.1).
#pragma once

#include <cstdint>
#include <string>

#include "rbvh/asset.h"
#include "rbvh/progress.h"

#pragma GCC visibility push(default)
namespace rbvh {

struct TilesetCounts {
  std::uint64_t tiles = 0;  ///< that have a file
  std::uint64_t bytes = 0;  ///< of all files
};

/// Writes the folder: tileset.json, and GLB files of about 50,000 triangles or points, as level_mesh() makes
/// them. Coarser levels are replaced by finer ones; a tile's geometricError is its level's error. The root's
/// transform adds the shift, and makes metres of coordinates whose unit is known. The folder must not be
/// there, or be empty, or hold such a tileset alone and `overwrite` be set; that is replaced at once. Throws
/// Error(kUsage) for an asset that is no pair, Error(kFailure).
TilesetCounts write_tileset(const std::string& folder, const Asset& pair, bool overwrite,
                            const Progress& progress = {});

}  // namespace rbvh
#pragma GCC visibility pop
