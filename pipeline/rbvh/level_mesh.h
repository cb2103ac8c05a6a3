// A level as a scan: triangles of a mesh, discs of a cloud. What other programs read, and what coarser levels
// are derived from.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/rbvh/rbvh.h"
#include "rbvh/mesh.h"

namespace rbvh {

/// Of a mesh the quads of its tiles that trim_tiles() leaves, two triangles each, and the primitives,
/// stitched together; a level of primitives alone is these as they are. Of a cloud a disc for each texel, and
/// the primitives. With normals and, where the level has them, colours; with object ids where
/// keeps_objects().
Scan level_mesh(const Level& level, bool is_cloud, LevelMeshCounts* counts = nullptr);

/// The level's object ids, each once.
std::vector<std::uint32_t> objects_of(const Level& level);

/// Whether level_mesh() keeps them: where there is one, of clouds, and of levels of primitives alone. Tiles
/// of a mesh are stitched whatever object they are of.
bool keeps_objects(const Level& level, bool is_cloud);

}  // namespace rbvh
