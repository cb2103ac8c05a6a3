// Joins patches of one surface, with gaps between them, to one mesh.
#pragma once

#include <cstdint>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// Of each vertex the patch that it belongs to, and how far gaps reach there: about the length of the patch's
/// edges, scan units. 0: the patch is complete there; such vertices are not joined to each other.
struct Patches {
  std::vector<std::uint32_t> of_vertex;
  std::vector<float> gap;
};

struct StitchCounts {
  std::uint64_t welded_vertices = 0;    ///< moved to one of another patch
  std::uint64_t added_triangles = 0;    ///< that close gaps
  std::uint64_t dropped_triangles = 0;  ///< without area after welding, or there twice
};

/// Welds vertices at the patches' boundary that are close to one of a lower patch; closes gaps with
/// triangles, those first that are equilateral rather than long (the empty circle of Delaunay, along the
/// surface; Bernardini et al., "The Ball-Pivoting Algorithm", 1999, for patches that are there already); and
/// closes the small holes that are left between three or more of them. Edges get at most two triangles. The
/// mesh needs normals and no properties; vertices that no triangle uses go. Deterministic.
StitchCounts stitch(Scan& mesh, const Patches& patches);

/// Edges with one triangle, and with more than two or two that face different ways. Vertices at one place are
/// one.
struct EdgeCounts {
  std::uint64_t open = 0, non_manifold = 0;
};
EdgeCounts count_edges(const Scan& mesh);

}  // namespace rbvh
