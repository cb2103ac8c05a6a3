// Fewer primitives within an error: what a level is built from.
#pragma once

#include "rbvh/scan.h"

namespace rbvh {

/// A mesh by edge collapse under quadric errors (Garland & Heckbert 1997; meshoptimizer), up to `error` (scan
/// units, about the rms distance): its vertices are some of the scan's, with their attributes. Objects stay
/// apart, and no component vanishes or becomes flat: one that would keeps its triangles. Edges of the surface
/// that meet but for rounding (a quarter of the error) are closed; flaps that collapses leave go. A large
/// mesh is simplified in parts at once, up to 1.3 times the error, which comes as near to the scan; not where
/// their borders, which stay, would be more than a small share of what is left. A cloud stays as it is.
/// Viewpoints and scalar properties are left out. Deterministic.
Scan simplify(const Scan& scan, float error);

}  // namespace rbvh
