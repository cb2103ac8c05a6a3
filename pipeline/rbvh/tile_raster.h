// Tiles while their texels are on the device: what the steps of rasterize.h share.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/rbvh/leaf_policy.h"
#include "pipeline/rbvh/partition.h"
#include "pipeline/rbvh/primitives.h"
#include "pipeline/rbvh/runs.h"

namespace rbvh {

struct RasterConfig {
  float rho = 0;                    ///< a density: texels_per_area(), per scan unit squared
  float quantum = 0;                ///< of heights, scan units; 0: a small part of a texel
  bool separates_boundary = false;  ///< primitives at boundary edges are not in tiles
  FaultLimits limits = {};
};

/// Dilation radii in texels: how far past its edge a primitive gives texels their heights.
struct Dilation {
  float own;     ///< in its own tile
  float border;  ///< in tiles that it overlaps; also how far tiles extend past their primitives
};
inline constexpr Dilation kDilation{1.0f, 1.5f};

/// Texels keep their places in the buffers from first to last, also where tiles are dropped.
struct TileRaster {
  const Primitives& primitives;
  const Partition& partition;
  const RasterConfig& config;
  std::vector<std::uint32_t> nodes;  ///< one a tile
  std::vector<RasterTile> tiles = {};
  Buffer<RasterTile> device_tiles = {};  ///< upload_tiles()
  Buffer<std::uint32_t> keys = {};       ///< kernels/build/texel_key.h
  std::uint64_t texel_count = 0;

  const Device& device() const { return primitives.device; }
  const PartitionNode& node(std::size_t k) const { return partition.nodes[nodes[k]]; }
  std::uint32_t discs() const { return primitives.discs ? 1 : 0; }

  void upload_tiles() { device_tiles = Buffer<RasterTile>(device(), tiles); }

  /// A kernel with a work item for each tile, whose first arguments are the tiles and their number.
  template <class... Args>
  void run_over_tiles(std::string_view file, std::string_view entry, const Args&... args) const {
    device()
        .kernel(file, entry)
        .run(tiles.size(), job_group_size(device()), device_tiles, static_cast<std::uint32_t>(tiles.size()),
             args...);
  }
};

inline constexpr std::uint32_t kTileRunLength = 128;

/// Runs of the tiles' own primitives.
Runs own_runs(const TileRaster& raster);

}  // namespace rbvh
