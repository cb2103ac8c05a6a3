// Rays as scripts have them: tables of numbers, one row a ray.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include "rbvh/progress.h"
#include "rbvh/tracer.h"

#pragma GCC visibility push(default)
namespace rbvh {

/// Of any values.
struct RayRows {
  const void* data = nullptr;  ///< rows x columns floats or doubles, row by row
  bool is_double = false;
  std::size_t columns = 6;  ///< 6 or 8: origin, direction, [tmin, tmax]
  std::size_t rows = 0;
  Vec3d shift{};  ///< subtracted from the origins, in double
};

/// Casts them, some at a time, and meanwhile has another thread give `write` the hits of the ones before, in
/// their order: those from ray `first` on. A miss has t = +infinity, RBVH_NO_LEAF and else zeros; a ray that
/// is not finite or has no direction misses. Returns the number of such rays.
std::uint64_t cast_rows(const Tracer& tracer, const RayRows& rays, RayQuery query,
                        const std::function<void(std::size_t first, std::span<const Hit>)>& write,
                        const Progress& progress = {});

}  // namespace rbvh
#pragma GCC visibility pop
