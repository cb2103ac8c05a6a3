// The level of detail of each patch and of its borders. Two patches that share an edge both give it the
// coarser one's level, so that the surface has no cracks.
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

/// The mesh's edge under each border of each patch. Edges are identified by their ends' positions, so that a
/// mesh that repeats vertices along its UV seams is one surface.
struct PatchEdges {
  std::vector<std::array<std::uint32_t, 4>> of_patch;
  std::uint32_t count = 0;
};
PatchEdges find_edges(const Proxy& proxy);

/// Adds borders to a level for each patch, each at most its tile's.
std::vector<PatchLevel> match_borders(const PatchEdges& edges, std::span<const std::uint32_t> levels);

/// Every tile's own level, or `most` where that is coarser.
std::vector<std::uint32_t> uniform_levels(const Proxy& proxy, std::uint32_t most);

}  // namespace rbvh
