// Where a mesh is shaded as two sides that meet, and not as one that is round.
#pragma once

#include <cstdint>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// The cosine of the angle between two faces' normals (50 degrees) from which on their edge is a crease.
inline constexpr float kCreaseCosine = 0.64f;

/// A mesh whose vertices on creases stand several times, once for each side.
struct CreasedMesh {
  std::vector<Triangle> triangles;    ///< the mesh's, with these vertices
  std::vector<std::uint32_t> copies;  ///< vertex number positions.size() + i is copies[i] of the mesh again
};

/// Sides are faces around a vertex that follow from each other across edges that are no creases. Faces
/// without an area and slivers part nothing.
CreasedMesh split_creases(const Scan& mesh);

/// Unit normals of its vertices, as vertex_normals() has them.
std::vector<Vec3f> vertex_normals(const Scan& mesh, const CreasedMesh& creased);

}  // namespace rbvh
