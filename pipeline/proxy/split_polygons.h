// Splits polygons into quads.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/proxy/polygon_mesh.h"
#include "pipeline/proxy/proxy.h"

namespace rbvh {

/// Quads with texture coordinates (and normals, where all corners of the file have one) at their corners.
struct UvQuads {
  std::vector<Vec3d> positions;
  std::vector<Quad> quads;
  std::vector<std::array<Uv, 4>> uvs;
  std::vector<std::array<Vec3d, 4>> normals;  ///< or empty
};

/// Vertices at one position become one. Where any face is no quad, all faces are split from their centre to
/// the middles of their edges, so that no vertex lies on an edge of another face. `no_quads` and
/// `dropped` count faces that are no quads, and those with fewer than three different corners, which are
/// dropped. Throws Error(kInput) for faces without texture coordinates, and where no face is left.
UvQuads split_polygons(const PolygonMesh& mesh, const std::string& file, std::uint64_t& no_quads,
                       std::uint64_t& dropped);

}  // namespace rbvh
