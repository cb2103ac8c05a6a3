#include "pipeline/rbvh/rasterize.h"

#include <algorithm>

#include "pipeline/rbvh/tile_blend.h"
#include "pipeline/rbvh/tile_border.h"
#include "pipeline/rbvh/tile_faults.h"
#include "pipeline/rbvh/tile_frame.h"
#include "pipeline/rbvh/tile_texels.h"

namespace rbvh {
namespace {

struct OwnFaults {
  std::vector<TileFaults> counts;
  std::vector<float> middles;  ///< count_faults()
};

/// Heights of the tiles' own primitives, and where they are a poor fit.
OwnFaults rasterize_own(TileRaster& raster, const Runs& own) {
  const Device& device = raster.device();
  raster.upload_tiles();
  raster.keys = Buffer<std::uint32_t>(device, raster.texel_count);
  Buffer<std::uint32_t> lowest(device, raster.texel_count), highest(device, raster.texel_count);
  for (Buffer<std::uint32_t>* buffer : {&raster.keys, &lowest, &highest}) buffer->fill(0);
  Buffer<TileFaults> faults(device, std::vector<TileFaults>(raster.tiles.size()));
  run_over(raster.device(), own, "build/rasterize", "rasterize_own", raster.device_tiles,
           raster.partition.references, raster.primitives.shape, raster.discs(), kDilation.own,
           kDilation.border, raster.keys, lowest, highest, faults);
  std::vector<float> middles = count_faults(raster, own, lowest, highest, faults);
  return {faults.read(), std::move(middles)};
}

/// From fine quanta to scan units, along the tile's w.
float scan_height(const RasterTile& tile, float w) {
  const float* row = tile.to_tile + 8;
  return (w - row[3]) / length(Vec3f{row[0], row[1], row[2]});
}

std::vector<Tile> make_drafts(TileRaster& raster) {
  const Runs own = own_runs(raster);
  const std::vector<TileAxes> axes = tile_axes(raster.partition, raster.nodes);
  place_tiles(raster, own, axes);
  const OwnFaults faults = rasterize_own(raster, own);
  std::vector<Tile> drafts(raster.tiles.size());
  for (std::size_t k = 0; k < drafts.size(); ++k) {
    const PartitionNode& node = raster.node(k);
    Tile& draft = drafts[k];
    draft.node = raster.nodes[k];
    draft.leaf.width = static_cast<std::uint16_t>(raster.tiles[k].width);
    draft.leaf.height = static_cast<std::uint16_t>(raster.tiles[k].height);
    draft.leaf.primitives = node.count();
    draft.leaf.object_id = std::min(node.objects.ids[0], node.objects.ids[1]);
    draft.flaws = find_flaws(faults.counts[k], raster.config.limits);
    draft.w = {axes[k].w[0], axes[k].w[1], axes[k].w[2]};
    draft.flaws.has_layers = raster.primitives.discs && faults.counts[k].layered > 0;
    draft.middle = scan_height(raster.tiles[k], faults.middles[k]);
  }
  return drafts;
}

/// Leaves out the tiles that are not to be completed; the texels of the others stay where they are.
void drop_other_tiles(TileRaster& raster, const std::vector<Tile>& drafts) {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < drafts.size(); ++k) {
    if (drafts[k].decision != LeafDecision::kRasterize) continue;
    raster.nodes[kept] = raster.nodes[k];
    raster.tiles[kept++] = raster.tiles[k];
  }
  raster.nodes.resize(kept);
  raster.tiles.resize(kept);
  if (kept > 0) raster.upload_tiles();
}

void finish_tiles(TileRaster& raster, std::vector<Tile>& finished, TileTexels& texels) {
  const Runs own = own_runs(raster);
  const Neighbors neighbors = find_neighbors(raster);
  merge_neighbors(raster, neighbors);
  if (raster.primitives.discs) return store_texels(raster, blend_discs(raster, neighbors), finished, texels);
  find_uncovered(raster, own, finished);
  store_texels(raster, interpolate_triangles(raster, own, neighbors), finished, texels);
}

}  // namespace

std::vector<Tile> rasterize_tiles(const Primitives& primitives, const Partition& partition,
                                  const std::vector<std::uint32_t>& nodes, const RasterConfig& config,
                                  const std::function<LeafDecision(const Tile&)>& decide,
                                  TileTexels& texels) {
  if (nodes.empty()) return {};
  TileRaster raster{primitives, partition, config, nodes};
  std::vector<Tile> drafts = make_drafts(raster);
  std::vector<Tile> finished;
  for (Tile& draft : drafts) {
    draft.decision = decide(draft);
    if (draft.decision == LeafDecision::kRasterize) finished.push_back(draft);
  }
  drop_other_tiles(raster, drafts);
  if (!finished.empty()) finish_tiles(raster, finished, texels);
  for (const Tile& draft : drafts)
    if (draft.decision != LeafDecision::kRasterize) finished.push_back(draft);
  return finished;
}

}  // namespace rbvh
