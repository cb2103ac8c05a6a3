// Quads from triangles: each triangle is matched with one neighbour, so that none is left over or split. A
// closed surface always has a perfect matching (Petersen, "Die Theorie der regulären graphs", 1891); at a
// boundary a triangle may stay alone, as a quad with a corner in the middle of its boundary edge.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/proxy/decimate.h"

namespace rbvh {

/// A quad of one triangle or two: (p, s, q, r) of the triangles (p, q, r) and (q, p, s), or of one triangle
/// (p, q, r) whose side p q is open, where s is the middle of it.
struct TrianglePair {
  static constexpr std::uint32_t kNone = UINT32_MAX;
  std::uint32_t first = kNone, second = kNone;   ///< triangles
  std::uint8_t first_side = 0, second_side = 0;  ///< the side that they share: from this corner to the next
};

/// Every triangle is in one pair. Pairs that make square, flat quads are preferred. Triangles must be those
/// of a manifold. `alone` tells how many have no partner.
std::vector<TrianglePair> pair_triangles(const BaseMesh& mesh, std::uint64_t& alone);

}  // namespace rbvh
