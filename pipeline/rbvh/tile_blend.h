// Blends a cloud's discs where they overlap into the heights, normals and colours of tiles.
#pragma once

#include "pipeline/rbvh/tile_border.h"
#include "pipeline/rbvh/tile_texels.h"

namespace rbvh {

/// Of the tiles' own discs and their neighbours, over the texels that have a key; their heights become the
/// blended ones. The result does not depend on how discs are spread over tiles.
TexelSignals blend_discs(const TileRaster& raster, const Neighbors& neighbors);

}  // namespace rbvh
