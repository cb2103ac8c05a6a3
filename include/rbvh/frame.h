// Two frames: the file's own coordinates, which people and scripts give and get, and the inner ones near the
// origin, in which float32 is fine enough. The file's are the inner ones plus the shift.
#pragma once

#include "rbvh/asset.h"

#pragma GCC visibility push(default)
namespace rbvh {

/// A scan's, or the one that a pair or proxy was made with; of a scene, that of the frame common to all its
/// objects. Asset::bounds, tracers' rays and hits are in inner coordinates.
Vec3d shift(const Asset& asset);

/// Asset::bounds in the file's coordinates.
Bounds3d file_bounds(const Asset& asset);

}  // namespace rbvh
#pragma GCC visibility pop
