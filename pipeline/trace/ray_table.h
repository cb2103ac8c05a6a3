// Rays and hits as scripts have them: tables of floats, one row a ray.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/trace/tracer.h"

namespace rbvh {

inline constexpr std::size_t kHitColumns = 8;  ///< t, normal x y z, u, v, leaf, flags

struct RayTableCounts {
  std::uint64_t hits = 0;
  std::uint64_t unusable = 0;  ///< rays not finite or without a direction, taken for misses
  double seconds = 0;          ///< casting alone
};

/// Casts rays of 6 or 8 `columns`: origin, direction, [tmin, tmax]; t is in units of the direction's length.
/// Out come kHitColumns a ray; a miss has t = +infinity, leaf -1 and else zeros. Values may be hostile.
std::vector<float> trace_table(const Tracer& tracer, std::span<const float> rays, std::size_t columns,
                               RayQuery query, const Progress& progress = {},
                               RayTableCounts* counts = nullptr);

}  // namespace rbvh
