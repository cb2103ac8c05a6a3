// From rasterised keys to the texels that are stored: heights, normals and colours of 16 bits each.
#pragma once

#include <vector>

#include "pipeline/rbvh/tile.h"
#include "pipeline/rbvh/tile_border.h"
#include "pipeline/rbvh/tile_raster.h"

namespace rbvh {

/// Of the raster's texels, as they are stored.
struct TexelSignals {
  Buffer<std::uint32_t> normals, colors;
};

TexelSignals make_signals(const TileRaster& raster);

/// Of the triangle that gave a texel its height, at the texel's centre.
TexelSignals interpolate_triangles(const TileRaster& raster, const Runs& own, const Neighbors& neighbors);

/// Completes the finished tiles and appends their texels.
void store_texels(const TileRaster& raster, const TexelSignals& signals, std::vector<Tile>& finished,
                  TileTexels& texels);

}  // namespace rbvh
