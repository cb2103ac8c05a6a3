// Checks the invariants that tracing an RBVH relies on: a file may be malicious.
#pragma once

#include <optional>
#include <string>

#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// Rows of to_tile have lengths in [1 / kLargestValue, kLargestValue], and coordinates are at most that:
/// squares and products of two still fit in a float.
inline constexpr float kLargestValue = 1e18f;
inline constexpr std::size_t kMaxLevels = 32, kMaxLayers = 16;
inline constexpr std::uint32_t kMaxChannels = 4;
inline constexpr std::uint32_t kMaxLeafPrimitives = 255;  ///< exact ones of a leaf
inline constexpr std::uint64_t kMaxTileTexels = 1u << 28;

/// Of levels and layers: 1 to 32 letters, digits, _ and -.
bool is_name(const std::string& name);

/// The first fault of the hierarchies, the tiles' places and the names, in words ("level Q0: node 7 ..."), or
/// nothing. Texels are not looked at. Takes time linear in nodes and leaves. Without a fault: every level has
/// a tree in which children come after their parent, every node but the root has one parent, every leaf one
/// node, no node is deeper than kMaxLeafHierarchyDepth (the root alone has depth 0); boxes and maps are
/// finite, maps invertible; tiles lie inside their atlas and have no more texels in all than it has.
std::optional<std::string> find_fault(const Rbvh& rbvh);

/// The same for the texels: every layer has exactly the atlas's.
std::optional<std::string> find_texel_fault(const Rbvh& rbvh);

}  // namespace rbvh
