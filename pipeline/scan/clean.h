// The cleaning that every ingest does: removes elements that cannot be seen and exact duplicates, settles
// coincident faces, and changes nothing else.
#pragma once

#include <cstddef>

#include "pipeline/scan/coincident.h"
#include "rbvh/scan.h"

namespace rbvh {

/// Removed elements.
struct CleanCounts {
  std::size_t non_finite_vertices = 0;  ///< a coordinate is NaN or infinite (as float)
  std::size_t non_finite_faces = 0;     ///< faces at such a vertex
  std::size_t duplicate_vertices = 0;  ///< same position, attributes and (points) object id as an earlier one
  std::size_t zero_area_faces = 0;     ///< corners equal or exactly on a line
  std::size_t duplicate_faces = 0;     ///< same corners with the same winding, same object id
  CoincidentCounts coincident;         ///< pairs of faces with the same corners and opposite windings
  std::size_t unreferenced_vertices = 0;  ///< of a mesh, in no face that is left
};

/// Of equal elements the first stays, and faces refer to it. The mesh may have no faces afterwards, the scan
/// no vertices: the caller checks.
CleanCounts clean(Scan& scan);

/// The vertex before `i` that is equal in position (-0 equals +0) and, with `attributes`, in all its
/// attributes; `i` itself for the first.
std::vector<std::uint32_t> first_equal_vertices(const Scan& scan, bool attributes);

}  // namespace rbvh
