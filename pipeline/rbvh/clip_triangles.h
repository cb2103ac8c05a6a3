// Triangles cut at a box.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// kBoth: nothing goes; what the box's faces cut is cut.
enum class BoxSide { kInside, kOutside, kBoth };

inline bool contains(const Bounds3d& box, Vec3d p) {
  for (int axis = 0; axis < 3; ++axis)
    if (!(p[axis] >= box.lo[axis] && p[axis] <= box.hi[axis])) return false;
  return true;
}

/// The box with its faces so far outside.
inline Bounds3d grown(const Bounds3d& box, double by) {
  const Vec3d margin{by, by, by};
  return {box.lo - margin, box.hi + margin};
}

/// Whether the boxes share a volume; flat ones count where they lie within the other.
inline bool overlap(const Bounds3d& a, const Bounds3d& b) {
  for (int axis = 0; axis < 3; ++axis)
    if (!(a.lo[axis] <= b.hi[axis] && b.lo[axis] <= a.hi[axis])) return false;
  return true;
}

/// What a cut leaves of a triangle ends at the edge from vertex a to b, and lies to its left.
struct CutEdge {
  std::uint32_t a = 0, b = 0;
  std::uint32_t of = 0;  ///< the triangle's number before
};

/// Keeps what lies on that side of the box of a mesh's triangles, in their order, and returns for each the
/// number of the one it is a part of. Those that the box's faces cut become several, with new vertices behind
/// the mesh's own, moved to the lattice; no others change. Triangles with an edge between the same places are
/// cut at the same places of it, so that no gap opens. Parts without an area go. Vertices that no triangle
/// uses stay. `cuts`: gets the edges that lie on the box's faces.
std::vector<std::uint32_t> clip_triangles(Scan& mesh, const Bounds3d& box, BoxSide side,
                                          const Lattice& lattice, std::vector<CutEdge>* cuts = nullptr);

}  // namespace rbvh
