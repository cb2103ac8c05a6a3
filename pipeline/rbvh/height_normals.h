// Smooth normals of a tile's surface, from its heights.
#pragma once

#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// Unit, in scan space, at a texel that has a height: from its neighbours along u and v that have one and are
/// not a step away.
Vec3f height_normal(const Level& level, const RbvhLeaf& leaf, int x, int y);

/// The layer "normal" of a level that stores none.
Layer make_normal_layer(const Level& level);

/// The part of the texels with a height whose stored normals, the layer "normal", differ from those of their
/// heights by more than `degrees`.
double normals_apart(const Level& level, const Layer& normals, double degrees);

}  // namespace rbvh
