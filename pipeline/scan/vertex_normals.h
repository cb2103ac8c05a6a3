// Smooth normals of a mesh that has none.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// Unit normals per vertex: the area-weighted mean of the triangles around it; zero for a vertex without any.
std::vector<Vec3f> vertex_normals(const Scan& scan);

/// The same where the scan's triangles have corners of other numbers, less than `count`.
std::vector<Vec3f> vertex_normals(const Scan& scan, std::span<const Triangle> corners, std::size_t count);

}  // namespace rbvh
