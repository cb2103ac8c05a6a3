// Smooth normals of a mesh that has none.
#pragma once

#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// Unit normals per vertex: the area-weighted mean of the triangles around it; zero for a vertex without any.
std::vector<Vec3f> vertex_normals(const Scan& scan);

}  // namespace rbvh
