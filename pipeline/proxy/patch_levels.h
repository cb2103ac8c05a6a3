// Which level of detail each patch of a proxy is shown at, and what its borders must be so that nothing
// cracks: two patches that share an edge both give it the coarser one's level.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/proxy/proxy.h"

namespace rbvh {

/// 2^level micro-quads a side; of each border (from corner i to corner i + 1) at most as many.
struct PatchLevel {
  std::uint32_t level = 0;
  std::array<std::uint32_t, 4> edges{};
  bool operator==(const PatchLevel&) const = default;
};

/// The level of a tile: log2(side - 1).
std::uint32_t tile_level(const PatchTile& tile);

/// Which edge of the mesh each border of each patch lies on. Edges are told by their ends' places, so a mesh
/// that repeats vertices along its UV seams is still one surface.
struct PatchEdges {
  std::vector<std::array<std::uint32_t, 4>> of_patch;
  std::uint32_t count = 0;
};
PatchEdges find_edges(const Proxy& proxy);

/// A level for each patch, each at most its tile's, becomes levels with borders.
std::vector<PatchLevel> match_borders(const PatchEdges& edges, std::span<const std::uint32_t> levels);

/// Every tile's own level, or `most` where that is less.
std::vector<std::uint32_t> uniform_levels(const Proxy& proxy, std::uint32_t most);

}  // namespace rbvh
