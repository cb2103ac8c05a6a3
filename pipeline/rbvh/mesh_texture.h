// The colours of a level's layer `texture` as a texture of its mesh, for programs that know no pairs.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/rbvh/rbvh.h"
#include "rbvh/scan.h"

namespace rbvh {

/// For each triangle of the level's mesh (level_mesh.h) the leaf whose surface it lies on. Empty for a level
/// without such a layer.
std::vector<std::uint32_t> textured_leaves(const Level& level, const Scan& mesh);

/// Gives a mesh of the level's, or a part of one, a texture: the layer's tiles of its triangles' leaves, one
/// of `leaves` each, packed into one image, whose file is not made yet. Texels without a value take the
/// nearest one's. Throws Error(kBudget) where the image would be over 65535 texels wide or high.
void add_texture(const Level& level, std::span<const std::uint32_t> leaves, Scan& mesh);

}  // namespace rbvh
