// OBJ of artists' base meshes: polygons of any size with a texture coordinate and normal per corner.
// (io/obj.h, which reads scans, makes triangles and keeps neither.)
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/proxy/polygon_mesh.h"

namespace rbvh {

/// Hostile input is expected. Throws Error(kInput) with the line for what is no OBJ, is cut, has indices out
/// of range, or has no face.
PolygonMesh read_polygon_obj(std::string_view bytes, const std::string& file);

}  // namespace rbvh
