// A level as a scan: triangles of a mesh, discs of a cloud. What other programs read, and what coarser levels
// are derived from.
#pragma once

#include "pipeline/rbvh/rbvh.h"
#include "rbvh/mesh.h"

namespace rbvh {

/// Of a mesh the quads of its tiles that trim_tiles() leaves, two triangles each, and the primitives,
/// stitched together; a level of primitives alone is these as they are. Of a cloud a disc for each texel, and
/// the primitives. With normals and, where the level has them, colours; without object ids.
Scan level_mesh(const Level& level, bool is_cloud, LevelMeshCounts* counts = nullptr);

}  // namespace rbvh
