// Checks what tracing a proxy relies on: a proxy may come from a hostile file.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "pipeline/proxy/patch_point.h"
#include "pipeline/proxy/proxy.h"

namespace rbvh {

/// The largest coordinate: squares still fit in a float.
inline constexpr float kLargestProxyValue = 1e18f;
/// Most texels of a map a side. A map's whole number of texels is bounded by its file's bytes.
inline constexpr std::uint32_t kMaxMapSide = 1u << 16;

/// The first fault in words ("patch 7 ..."), or nothing. Without a fault: there is a patch; indices and tiles
/// are in range; tiles do not overlap, unless they are the same; sides are 2^k + 1; positions and texels of
/// tiles are finite; longest_displacement is no shorter than any of its texels; patches that share an edge of
/// the base have one surface there (see proxy.h). Takes time linear in the texels.
std::optional<std::string> find_fault(const Proxy& proxy);

/// Sets each tile's longest_displacement to its texels' longest, rounded up.
void measure_displacements(Proxy& proxy);

/// An edge of the base as a quad has it: from its corner `edge` to the next one.
struct QuadEdge {
  std::uint32_t lower, upper;  ///< its vertices, the smaller index first
  std::uint32_t patch;
  std::uint8_t edge;   ///< 0 to 3
  bool is_from_lower;  ///< whether the quad goes from `lower` to `upper`
};

/// All edges of all quads, those of the same two vertices side by side, lower patches first. Edges between a
/// vertex and itself are left out.
std::vector<QuadEdge> sorted_edges(const std::vector<Quad>& quads);

/// The patches along one edge, and the micro-quads that the coarsest of them has there: the others' are a
/// multiple.
using EdgeWork = std::function<void(std::span<const QuadEdge> patches, std::uint32_t steps)>;
void for_each_edge(const Proxy& proxy, const EdgeWork& work);

/// Texel k of the patch along the edge, counted from the edge's lower vertex.
TexelPlace texel_along(const Proxy& proxy, const QuadEdge& edge, std::uint32_t k);

}  // namespace rbvh
