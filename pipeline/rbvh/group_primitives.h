// The leaves of a level that holds primitives: subtrees of the hierarchy that these are traced with.
#pragma once

#include "pipeline/rbvh/refine.h"
#include "rbvh/scan.h"

namespace rbvh {

/// Leaves of at most kMostLeafPrimitives triangles or discs, of one object each. The positions are those of
/// the lattice. `one_sided`: the triangles of a leaf all face along its frame's w, so that a layer over the
/// frame has a texel for each of their points.
RefinedLevel group_primitives(const Scan& scan, const Lattice& lattice, bool one_sided = false);

}  // namespace rbvh
