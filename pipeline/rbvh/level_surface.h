// A level's surface as triangles: what the march sees of its tiles.
#pragma once

#include <cstdint>
#include <functional>

#include "pipeline/rbvh/rbvh.h"
#include "pipeline/scan/closest_point.h"

namespace rbvh {

/// What the tracer sees of a level: the texel quads of its tiles whose four corners have a surface without a
/// step between them, as two triangles each, as far as their middle lies in the leaf's box.
TriangleSoup surface_of(const Level& level);
/// Calls for each of those quads, tile by tile: its first texel's place in the tile and in the atlas. Not for
/// leaves of primitives.
void for_each_quad(
    const Level& level,
    const std::function<void(std::uint32_t leaf, std::uint32_t x, std::uint32_t y, std::size_t texel)>& quad);
/// The same of one tile, as far as the quads' middle lies in `box`.
void for_each_leaf_quad(const Level& level, const RbvhLeaf& leaf, const Bounds3f& box,
                        const std::function<void(std::uint32_t x, std::uint32_t y, std::size_t texel)>& quad);

}  // namespace rbvh
