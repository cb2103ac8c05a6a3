// Faces that are wound the other way than those they share an edge with.
#pragma once

#include <cstddef>

#include "rbvh/scan.h"

namespace rbvh {

struct WindingCounts {
  std::size_t edges = 0;     ///< shared by two faces
  std::size_t opposite = 0;  ///< of them, between faces that are wound opposite ways
  std::size_t turned = 0;    ///< faces that orient_faces() turned
};

/// To its other side.
void turn_face(Scan& scan, std::size_t face);

/// Vertices at one place count as one.
WindingCounts count_winding(const Scan& scan);

/// Turns faces so that those at an edge of two agree: across each such edge, from one face of a connected
/// part to all. A closed part faces outwards, by its volume's sign; of an open one the larger area keeps its
/// side. Vertex normals of turned faces are left to be made anew: the scan's are dropped where a face was
/// turned.
WindingCounts orient_faces(Scan& scan);

}  // namespace rbvh
