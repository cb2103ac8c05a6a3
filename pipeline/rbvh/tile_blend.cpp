#include "pipeline/rbvh/tile_blend.h"

#include <algorithm>

namespace rbvh {
namespace {

/// Floats that kernels/build/tile_blend.cl sums for a texel.
constexpr std::size_t kSums = 11;
/// Texels beyond a disc that it counts for at least.
constexpr float kFilterTexels = 1.5f;

struct TileDiscs {
  std::vector<std::uint32_t> firsts, discs;  ///< of tile k: discs[firsts[k], firsts[k + 1])
};

/// Each tile's own discs and its neighbours, by number: a sum of floats depends on the order.
TileDiscs list_discs(const TileRaster& raster, const Neighbors& neighbors) {
  const std::vector<std::uint32_t> own = raster.partition.references.read(),
                                   others = neighbors.overlaps.primitives.read();
  const std::vector<std::uint32_t>& firsts = neighbors.overlaps.firsts;
  TileDiscs lists{{0}, {}};
  for (std::size_t k = 0; k < raster.tiles.size(); ++k) {
    const auto at = static_cast<std::ptrdiff_t>(lists.discs.size());
    lists.discs.insert(lists.discs.end(), own.begin() + raster.node(k).begin,
                       own.begin() + raster.node(k).end);
    lists.discs.insert(lists.discs.end(), others.begin() + firsts[k], others.begin() + firsts[k + 1]);
    std::sort(lists.discs.begin() + at, lists.discs.end());
    lists.firsts.push_back(static_cast<std::uint32_t>(lists.discs.size()));
  }
  return lists;
}

}  // namespace

TexelSignals blend_discs(const TileRaster& raster, const Neighbors& neighbors) {
  const Device& device = raster.device();
  const Primitives& primitives = raster.primitives;
  const TileDiscs lists = list_discs(raster, neighbors);
  TexelSignals signals = make_signals(raster);
  Buffer<float> sums(device, kSums * raster.texel_count);
  sums.fill(0);
  raster.run_over_tiles("build/tile_blend", "tile_blend", Buffer<std::uint32_t>(device, lists.firsts),
                        Buffer<std::uint32_t>(device, lists.discs), primitives.shape, primitives.reach,
                        primitives.order, primitives.colors, primitives.has_colors ? 1u : 0u, kFilterTexels,
                        raster.config.limits.layer_gap, sums, raster.keys, signals.normals, signals.colors);
  return signals;
}

}  // namespace rbvh
