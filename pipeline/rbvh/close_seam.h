// Where two levels were cut at one box, their borders are as far apart as both are from the surface.
#pragma once

#include "pipeline/rbvh/cut_level.h"

namespace rbvh {

/// Adds triangles to `added` that lie between its cut edges and those of `kept`, where these are within
/// `most` of each other (scan units). Their corners are the edges' ends, so that no slit is left.
void close_seam(const LooseLevel& kept, LooseLevel& added, double most);

}  // namespace rbvh
