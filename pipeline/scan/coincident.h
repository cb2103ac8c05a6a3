// Faces that coincide and face opposite ways. Rays tell them apart by rounding alone, and no surface has
// both.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

struct CoincidentCounts {
  std::size_t flaps = 0;    ///< pairs that went: the surface closes without them
  std::size_t closing = 0;  ///< pairs of which the face that closes the surface stays
  std::size_t sheets = 0;   ///< pairs of which the first stays, a sheet that is hit from both sides

  std::size_t pairs() const { return flaps + closing + sheets; }
};

/// What becomes of a face.
enum class FaceFate : std::uint8_t {
  kStays,
  kGoes,        ///< a flap's, or the one of a closing pair that does not close the surface
  kSheet,       ///< the first of a sheet's pair
  kSheetsBack,  ///< the second of it
};

/// Settles each pair of faces with the same corners, opposite windings and one object id. Pairs that share
/// edges form a group. Faces stay that close the surface, which is open at their edges otherwise. Of what is
/// left, a group that no other face adjoins, and one that is larger than `largest_flap` (scan units), is a
/// sheet; the others are flaps without thickness, and go. `triangles`: by the numbers of positions, of which
/// vertices at one place have one. Empty: all stay.
std::vector<FaceFate> settle_coincident(const std::vector<Triangle>& triangles,
                                        const std::vector<Vec3f>& positions,
                                        const std::vector<std::int32_t>& object_ids, float largest_flap,
                                        CoincidentCounts& counts);

/// Of the diagonal: `largest_flap` where nothing else is asked for. What leaks and walls are, too.
inline constexpr float kLargestFlap = 0.01f;
/// The same for levels, to their lattice's step: what rounding folds.
inline constexpr float kLargestFold = 16;

}  // namespace rbvh
