// Rasterises nodes of the partition into tiles on the device (section 3.3 of the paper).
#pragma once

#include <functional>
#include <vector>

#include "pipeline/rbvh/partition.h"
#include "pipeline/rbvh/primitives.h"
#include "pipeline/rbvh/tile.h"
#include "pipeline/rbvh/tile_raster.h"

namespace rbvh {

/// `decide` is asked about each tile once its own primitives are rasterised: its node, size, primitives,
/// flaws and normal are known. Where the answer is kRasterize the tile is completed and its texels appended.
/// Returned: these in the nodes' order, then the others.
std::vector<Tile> rasterize_tiles(const Primitives& primitives, const Partition& partition,
                                  const std::vector<std::uint32_t>& nodes, const RasterConfig& config,
                                  const std::function<LeafDecision(const Tile&)>& decide, TileTexels& texels);

}  // namespace rbvh
