// Rays and hits as scripts have them: tables of floats, one row a ray.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "rbvh/progress.h"
#include "rbvh/tracer.h"

namespace rbvh {

inline constexpr std::size_t kHitColumns = 8;  ///< t, normal x y z, u, v, leaf, flags

/// Where rays come from and hits go, some at a time. `read` and `write` are called by other threads, each by
/// one.
struct RayStream {
  std::size_t columns = 6;                            ///< of a ray, 6 or 8: origin, direction, [tmin, tmax]
  std::uint64_t rows = 0;                             ///< in all, for the progress
  std::function<std::size_t(std::span<float>)> read;  ///< the next rows; how many, 0 at the end
  std::function<void(std::span<const Hit>)> write;    ///< of each of them, in their order
  std::function<void()> stop = {};                    ///< called where all ends early: `read` waits no longer
};

struct RayTableCounts {
  std::uint64_t rays = 0, hits = 0;
  std::uint64_t unusable = 0;  ///< rays not finite or without a direction, taken for misses
  double seconds = 0;          ///< casting alone, with the way to the device and back
};

/// What trace_stream() takes on the host and on the device.
std::uint64_t ray_stream_bytes(std::uint64_t rays);

/// Casts rays while the next are read and the last ones' hits written. t is in units of the direction's
/// length; a miss has t = +infinity, RBVH_NO_LEAF and else zeros. Values may be hostile.
RayTableCounts trace_stream(const Tracer& tracer, const RayStream& stream, RayQuery query,
                            const Progress& progress = {});

/// kHitColumns for each hit: of a miss the leaf is -1.
std::vector<float> hit_rows(std::span<const Hit> hits);

}  // namespace rbvh
