// A tile's border: overlapping neighbours, primitives of other tiles that extend into it, are rasterised
// there too, so that neighbouring tiles agree on the surface between them. They replace the paper's overlap
// of 5 % at each split, which multiplies the references.
#pragma once

#include "pipeline/rbvh/overlaps.h"
#include "pipeline/rbvh/tile_raster.h"

namespace rbvh {

struct Neighbors {
  Overlaps overlaps;
  Runs runs;  ///< of overlaps.primitives
};

/// Of the tiles' boxes, dilated by the border's radius.
Neighbors find_neighbors(const TileRaster& raster);

/// Rasterises them over the borders and drops texels past the surface's end.
void merge_neighbors(const TileRaster& raster, const Neighbors& neighbors);

}  // namespace rbvh
