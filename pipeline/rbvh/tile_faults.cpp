#include "pipeline/rbvh/tile_faults.h"

#include <algorithm>

namespace rbvh {
namespace {

/// A covered triangle extends no further (texels) into a cell of texels with an empty corner.
constexpr float kUncoveredSlack = 0.02f;

}  // namespace

std::vector<float> count_faults(const TileRaster& raster, const Runs& own,
                                const Buffer<std::uint32_t>& lowest, const Buffer<std::uint32_t>& highest,
                                Buffer<TileFaults>& faults) {
  const FaultLimits& limits = raster.config.limits;
  const Buffer<float> middles(raster.device(), raster.tiles.size());
  raster.run_over_tiles("build/tile_faults", "tile_faults_steps", raster.keys, lowest, highest,
                        limits.layer_gap, limits.step_limit, faults, middles);
  if (!raster.primitives.discs)
    run_over(raster.device(), own, "build/tile_faults", "tile_faults_misses", raster.device_tiles,
             raster.partition.references, raster.primitives.shape, limits.miss_limit, raster.keys, faults);
  return middles.read();
}

void find_uncovered(const TileRaster& raster, const Runs& own, std::vector<Tile>& finished) {
  std::uint32_t room = 1 << 12;
  std::vector<std::uint32_t> list;
  for (bool is_whole = false; !is_whole; room = list[0]) {
    Buffer<std::uint32_t> device_list(raster.device(), room + 1);
    device_list.fill(0);
    run_over(raster.device(), own, "build/tile_faults", "tile_faults_uncovered", raster.device_tiles,
             raster.partition.references, raster.primitives.shape, kUncoveredSlack, raster.keys, room,
             device_list);
    list = device_list.read();
    is_whole = list[0] <= room;
  }
  const auto first = list.begin() + 1, last = first + list[0];
  std::sort(first, last);
  for (std::size_t k = 0; k < finished.size(); ++k)
    finished[k].uncovered.assign(std::lower_bound(first, last, raster.node(k).begin),
                                 std::lower_bound(first, last, raster.node(k).end));
}

}  // namespace rbvh
