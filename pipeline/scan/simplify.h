// Fewer primitives within an error: what a level is built from.
#pragma once

#include <cstdint>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// A level's vertices are rounded to so much of its error, which adds little to it.
inline constexpr float kLatticeStep = 0.25f;
/// Vertices at one place are one where the cosine between their normals is as large.
inline constexpr float kAlikeNormal = 0.99f;

/// A mesh by edge collapse (collapse_edges.h) within `error` (scan units, about the rms distance): vertices
/// of the scan, with their attributes, moved to where their errors are least. Objects stay apart, and nothing
/// vanishes or becomes flat. Edges of the surface that meet but for rounding (a quarter of the error) are
/// closed. Where many triangles are far smaller than the error, finer steps come first. A cloud stays as it
/// is. Viewpoints and scalar properties are left out. `stays`, where given, tells of each vertex whether it
/// must stay (1) where it is, as others meet it there; it becomes that of the result's. Deterministic.
Scan simplify(const Scan& scan, float error, std::vector<std::uint8_t>* stays = nullptr);

}  // namespace rbvh
