// What a user says about an update, read.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "rbvh/geometry.h"

namespace rbvh {

/// A part of a pair: a box in the scan's own coordinates, or an object.
struct PairPart {
  std::optional<Bounds3d> box;
  std::optional<std::int32_t> object;
};

/// "x,y,z,x,y,z": two opposite corners of a box; or "object:N". Throws Error(kUsage).
PairPart parse_pair_part(std::string_view text);

}  // namespace rbvh
