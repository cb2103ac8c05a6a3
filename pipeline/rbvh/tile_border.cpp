#include "pipeline/rbvh/tile_border.h"

#include "pipeline/rbvh/tile_frame.h"

namespace rbvh {
namespace {

/// Texels from a covered centre up to which a tile keeps texels: where the surface folds away from the tile,
/// over a crest say, and where it ends.
constexpr float kFoldDilation = 1.2f, kEndDilation = 0.6f;
/// And from a primitive at a boundary edge that is not in tiles itself.
constexpr float kBoundaryDistance = 0.45f;

}  // namespace

Neighbors find_neighbors(const TileRaster& raster) {
  std::vector<OverlapQuery> queries(raster.tiles.size());
  for (std::size_t k = 0; k < raster.tiles.size(); ++k) {
    const PartitionNode& node = raster.node(k);
    float dilation = kDilation.border * texel_size(raster.tiles[k]);
    if (raster.primitives.discs)
      dilation += (raster.primitives.mean_reach - 1) * raster.primitives.mean_radius;
    for (int c = 0; c < 3; ++c) {
      queries[k].lo[c] = node.sums.lo[c] - dilation;
      queries[k].hi[c] = node.sums.hi[c] + dilation;
    }
    queries[k].begin = node.begin;
    queries[k].end = node.end;
  }
  Neighbors neighbors;
  neighbors.overlaps = find_overlaps(raster.partition, raster.primitives, queries);
  const std::vector<std::uint32_t>& firsts = neighbors.overlaps.firsts;
  std::vector<Run> runs;
  for (std::uint32_t k = 0; k < raster.tiles.size(); ++k)
    append_runs(runs, k, firsts[k], firsts[k + 1], kTileRunLength);
  neighbors.runs = upload_runs(raster.device(), std::move(runs));
  return neighbors;
}

void merge_neighbors(const TileRaster& raster, const Neighbors& neighbors) {
  const float dilation = kDilation.border;
  Buffer<std::uint32_t> overlap_keys(raster.device(), raster.texel_count);
  overlap_keys.fill(0);
  raster.run_over_tiles("build/tile_border", "tile_border_widen", raster.keys);
  run_over(raster.device(), neighbors.runs, "build/tile_border", "tile_border_overlaps", raster.device_tiles,
           neighbors.overlaps.primitives, raster.primitives.shape, raster.discs(),
           raster.primitives.area_normal, raster.config.separates_boundary ? kBoundaryDistance : 2 * dilation,
           dilation, raster.config.limits.layer_gap, raster.keys, overlap_keys);
  raster.run_over_tiles("build/tile_border", "tile_border_merge", raster.keys, overlap_keys, dilation,
                        kFoldDilation, kEndDilation);
}

}  // namespace rbvh
