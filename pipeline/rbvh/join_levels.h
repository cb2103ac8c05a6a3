// Leaves of two levels as one level.
#pragma once

#include <string>
#include <vector>

#include "pipeline/rbvh/cut_level.h"

namespace rbvh {

/// What one of two levels has and the other has not.
struct JoinCounts {
  bool lacks_colors = false;         ///< what is added has none, and is white
  bool drops_colors = false;         ///< what is added has some, which are left out
  std::vector<std::string> lacking;  ///< a user's layers without values there
};

/// The level `before` with its leaves `untouched` (in ascending order), `kept`, which were cut from others of
/// it, and `added`, whose frames and positions are rounded to the same grid and lattice. The result has the
/// layers of `before`. Leaves that are not new stay as they are, tiles in their places where most of the
/// atlas is used. A user's layers over new leaves of primitives are sampled from `before`. `texel`:
/// primitive_texel() of the level. There must be a leaf.
Level join_levels(const Level& before, const std::vector<std::uint32_t>& untouched, LooseLevel&& kept,
                  LooseLevel&& added, float texel, JoinCounts& counts);

}  // namespace rbvh
