// The cleaning that every ingest does: what goes cannot be seen or is there twice. Everything else is left as
// it is.
#pragma once

#include <cstddef>

#include "pipeline/scan/scan.h"

namespace rbvh {

/// What went.
struct CleanCounts {
  std::size_t non_finite_vertices = 0;  ///< a coordinate is NaN or infinite (as float)
  std::size_t non_finite_faces = 0;     ///< faces at such a vertex
  std::size_t duplicate_vertices = 0;  ///< same position, attributes and (points) object id as an earlier one
  std::size_t zero_area_faces = 0;     ///< corners equal or exactly on a line
  std::size_t duplicate_faces = 0;     ///< same corners in the same turning sense, same object id
  std::size_t unreferenced_vertices = 0;  ///< of a mesh, in no face that is left
};

/// Only the first of equal elements stays; faces move on to it. A mesh may end without faces, a scan without
/// vertices: the caller judges.
CleanCounts clean(Scan& scan);

/// The vertex before `i` that is equal in position (-0 equals +0) and, with `attributes`, in all that goes
/// with it; `i` itself for the first.
std::vector<std::uint32_t> first_equal_vertices(const Scan& scan, bool attributes);

}  // namespace rbvh
