#include "pipeline/rbvh/tile_raster.h"

namespace rbvh {

Runs own_runs(const TileRaster& raster) {
  std::vector<Run> runs;
  for (std::uint32_t k = 0; k < raster.nodes.size(); ++k)
    append_runs(runs, k, raster.node(k).begin, raster.node(k).end, kTileRunLength);
  return upload_runs(raster.device(), std::move(runs));
}

}  // namespace rbvh
