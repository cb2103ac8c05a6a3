// Makes any triangles a mesh that half-edges can hold: cuts edges of more than two triangles and between
// neighbours of opposite orientation, and leaves small components out.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/scan/scan.h"

namespace rbvh {

struct Manifold {
  std::vector<Vec3f> positions;  ///< a vertex; the same for vertices that a cut separated
  std::vector<Triangle>
      triangles;  ///< every edge in at most two, in opposite directions; every vertex in one fan
};

struct ManifoldCounts {
  std::uint64_t small_components = 0;  ///< left out, as their area is under the threshold
  std::uint64_t small_triangles = 0;   ///< in these
  std::uint64_t flat_triangles = 0;    ///< left out: two equal corners
  std::uint64_t cut_edges = 0;     ///< with more than two triangles, or neighbours of opposite orientation
  std::uint64_t cut_vertices = 0;  ///< vertices that became several
  std::uint64_t open_edges = 0;    ///< boundary edges, after cutting
  std::uint64_t components = 0;    ///< after cutting, small ones not counted
};

/// Vertices at the same position are one. Components with less than `min_component` of the whole area are
/// left out; the largest always stays. Needs finite positions and a triangle.
Manifold make_manifold(const Scan& scan, double min_component, ManifoldCounts& counts);

}  // namespace rbvh
