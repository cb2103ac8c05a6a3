// The tessellated reference: a proxy's displaced surface as a triangle mesh, which ray tracing it
// untessellated is compared with.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/proxy/patch_levels.h"
#include "pipeline/proxy/proxy.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

/// Vertex (i, j) of a patch's (2^level + 1)^2, bitwise what the device computes. On a border coarser than the
/// patch it snaps to one of the border's own vertices.
Vec3f patch_vertex(const Proxy& proxy, std::size_t patch, const PatchLevel& level, std::uint32_t i,
                   std::uint32_t j);

/// The mesh at these levels, patch after patch, each row by row; micro-quads as two triangles, without those
/// to which a coarse border leaves no area. Where given, `patches` gets each triangle's patch. Throws
/// Error(kBudget) beyond 2^32 vertices or triangles.
Scan tessellate(const Proxy& proxy, std::span<const PatchLevel> levels,
                std::vector<std::uint32_t>* patches = nullptr);

/// Every patch at its tile's own level, or at `most` where that is less.
Scan tessellate(const Proxy& proxy, std::uint32_t most, std::vector<std::uint32_t>* patches = nullptr);

}  // namespace rbvh
