// Where a tile lies: its plane, from the primitives' mean normal, and the smallest rectangle in it.
#pragma once

#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/rbvh/partition.h"
#include "pipeline/rbvh/primitives.h"
#include "pipeline/rbvh/tile_raster.h"

namespace rbvh {

/// The planes of these nodes of the partition.
std::vector<TileAxes> tile_axes(const Partition& partition, const std::vector<std::uint32_t>& nodes);

/// Rectangles, resolutions and places of the tiles' texels: fills in raster.tiles and raster.texel_count.
/// `own`: the tiles' own primitives. Throws Error(kBudget) where there are too many texels.
void place_tiles(TileRaster& raster, const Runs& own, const std::vector<TileAxes>& axes);

/// The side of a texel in scan units.
float texel_size(const RasterTile& tile);

}  // namespace rbvh
