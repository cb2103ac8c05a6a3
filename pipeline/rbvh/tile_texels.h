// From rasterised keys to the texels that are stored: heights, normals and colours of 16 bits each.
#pragma once

#include <vector>

#include "pipeline/rbvh/tile.h"
#include "pipeline/rbvh/tile_border.h"
#include "pipeline/rbvh/tile_raster.h"

namespace rbvh {

/// Completes the finished tiles and appends their texels. `neighbors`: none for discs.
void store_texels(const TileRaster& raster, const Runs& own, const Neighbors* neighbors,
                  std::vector<Tile>& finished, TileTexels& texels);

}  // namespace rbvh
