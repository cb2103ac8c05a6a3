// Where a height field is a poor fit for a tile's own primitives, and which of its triangles are uncovered.
#pragma once

#include <vector>

#include "pipeline/rbvh/tile.h"
#include "pipeline/rbvh/tile_raster.h"

namespace rbvh {

/// Adds to each tile's faults what its heights alone show. `lowest`, `highest`: kernels/build/rasterize.cl.
/// Returned: the heights halfway between a tile's layers, fine quanta.
std::vector<float> count_faults(const TileRaster& raster, const Runs& own,
                                const Buffer<std::uint32_t>& lowest, const Buffer<std::uint32_t>& highest,
                                Buffer<TileFaults>& faults);

/// Sets Tile::uncovered of the finished tiles.
void find_uncovered(const TileRaster& raster, const Runs& own, std::vector<Tile>& finished);

}  // namespace rbvh
