// glTF 2.0, as GLB or as JSON with its buffers beside it or inside.
#pragma once

#include <string>
#include <string_view>

#include "rbvh/scan.h"

namespace rbvh {

/// GLB's own first word, or JSON that speaks of an asset.
bool is_gltf(std::string_view bytes);

/// The triangles (also strips and fans) of the default scene's meshes, each placed by its nodes; where there
/// are none, the points. Each instance of a mesh is an object. Colours are the vertices' times the
/// material's, as sRGB. Quantised, sparse and compressed values (meshopt, Draco) are unpacked. What rbvh
/// wrote itself comes back in the coordinates that were written. `file` names the folder of buffers. Throws
/// Error(kInput).
RawScan read_gltf(std::string_view bytes, const std::string& file);

}  // namespace rbvh
