#include "pipeline/rbvh/tile_texels.h"

#include <algorithm>
#include <iterator>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/tile_frame.h"

namespace rbvh {
namespace {

/// Finer quanta than this fraction of a texel would store noise, and noise does not compress.
constexpr float kQuantaPerTexel = 256;
/// What a tile's box has beyond that of its primitives, texels.
constexpr float kBoundsTexels = 0.4f;

/// Heights in the tiles' own quanta; completes the leaves.
std::vector<std::uint16_t> quantize(const TileRaster& raster, std::vector<Tile>& finished) {
  const Device& device = raster.device();
  const Buffer<TileRange> device_ranges(device, raster.tiles.size());
  raster.run_over_tiles("build/tile_texels", "tile_texels_range", raster.keys, device_ranges);
  const std::vector<TileRange> ranges = device_ranges.read();
  std::vector<std::uint32_t> bases(raster.tiles.size());
  std::vector<float> scales(raster.tiles.size());
  for (std::size_t k = 0; k < raster.tiles.size(); ++k) {
    const RasterTile& from = raster.tiles[k];
    RBVH_CHECK(ranges[k].used > 0);
    bases[k] = ranges[k].lo;
    const auto range = static_cast<float>(ranges[k].hi - ranges[k].lo);
    // Fewer quanta within the level's error take fewer bits in the file.
    const float per_texel = raster.config.quantum > 0
                                ? std::min(kQuantaPerTexel, texel_size(from) / raster.config.quantum)
                                : kQuantaPerTexel;
    scales[k] = std::min(65534.0f / std::max(range, 1.0f), per_texel / from.texel_w);
    Tile& tile = finished[k];
    std::copy(std::begin(from.to_tile), std::end(from.to_tile), tile.leaf.to_tile);
    float* row = tile.leaf.to_tile + 8;
    for (int c = 0; c < 3; ++c) row[c] *= scales[k];
    row[3] = (row[3] - static_cast<float>(bases[k])) * scales[k] + 1.0f;
    tile.texels_used = ranges[k].used;
    const float margin = kBoundsTexels * texel_size(from);
    tile.bounds = raster.node(k).bounds();
    tile.bounds.lo = tile.bounds.lo - Vec3f{margin, margin, margin};
    tile.bounds.hi = tile.bounds.hi + Vec3f{margin, margin, margin};
  }
  const Buffer<std::uint16_t> heights(device, raster.texel_count);
  raster.run_over_tiles("build/tile_texels", "tile_texels_quantize", Buffer<std::uint32_t>(device, bases),
                        Buffer<float>(device, scales), raster.keys, heights);
  return heights.read();
}

/// Appends the tiles' texels, one tile after the other, as 16 bits each.
template <class T>
void append_texels(const TileRaster& raster, const std::vector<T>& from, std::vector<std::uint16_t>& to) {
  for (const RasterTile& tile : raster.tiles) {
    const auto first = from.begin() + static_cast<std::ptrdiff_t>(tile.offset);
    std::transform(first, first + static_cast<std::ptrdiff_t>(tile.width) * tile.height,
                   std::back_inserter(to), [](T value) { return static_cast<std::uint16_t>(value); });
  }
}

}  // namespace

TexelSignals make_signals(const TileRaster& raster) {
  TexelSignals signals{Buffer<std::uint32_t>(raster.device(), raster.texel_count),
                       Buffer<std::uint32_t>(raster.device(), raster.texel_count)};
  signals.normals.fill(0);
  signals.colors.fill(0);
  return signals;
}

TexelSignals interpolate_triangles(const TileRaster& raster, const Runs& own, const Neighbors& neighbors) {
  const Primitives& primitives = raster.primitives;
  TexelSignals signals = make_signals(raster);
  const auto add = [&](const Runs& runs, const Buffer<std::uint32_t>& references, float dilation) {
    run_over(raster.device(), runs, "build/tile_texels", "tile_texels_signals", raster.device_tiles,
             references, primitives.shape, dilation, kDilation.border, raster.keys, primitives.order,
             primitives.indices, primitives.normals, primitives.colors, primitives.has_colors ? 1u : 0u,
             signals.normals, signals.colors);
  };
  add(own, raster.partition.references, kDilation.own);
  add(neighbors.runs, neighbors.overlaps.primitives, kDilation.border);
  return signals;
}

void store_texels(const TileRaster& raster, const TexelSignals& signals, std::vector<Tile>& finished,
                  TileTexels& texels) {
  const std::vector<std::uint16_t> heights = quantize(raster, finished);
  std::size_t first = texels.heights.size();
  for (Tile& tile : finished) {
    tile.first_texel = first;
    first += std::size_t{tile.leaf.width} * tile.leaf.height;
  }
  append_texels(raster, heights, texels.heights);
  append_texels(raster, signals.normals.read(), texels.normals);
  if (raster.primitives.has_colors) append_texels(raster, signals.colors.read(), texels.colors);
}

}  // namespace rbvh
