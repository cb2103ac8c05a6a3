// How far an RBVH level is from the scan it was made of, seen: exact and level hits of the same rays
// compared, in views around the object. (Distances between the surfaces themselves: surface_distance.h.)
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "rbvh/measure.h"

namespace rbvh {

/// What is wrong with one pixel. Interior: the exact tracer hits in its whole 3x3 neighbourhood (which lies
/// inside the image).
enum class PixelFault : std::uint8_t {
  kNone,
  kHole,  ///< interior, and the level misses
  kLeak,  ///< interior, and the level's hit is over 1% of the diagonal behind the neighbourhood's farthest
  kWall,  ///< interior, and it is over 1% of the diagonal before the neighbourhood's nearest
  kMaskAtSilhouette,  ///< one of the two hits, and the exact mask has an edge in the 3x3 neighbourhood
  kMaskElsewhere,  ///< one of the two hits, and no edge is near (a hole counts here too, but is marked kHole)
};

/// Faults of a view, row by row. `diagonal` is that of the scan's bounding box.
std::vector<PixelFault> find_faults(std::span<const Hit> exact, std::span<const Hit> level,
                                    std::uint32_t width, std::uint32_t height, float diagonal);

/// Reorders `values`.
Distribution distribution(std::vector<float>& values);

/// Differences of a view's pixels, kept so that views can be pooled.
struct HitDifferences {
  std::vector<float> dt, degrees;
};

/// Compares one view; appends its differences to `pool` where given.
HitFidelity compare_hits(std::span<const Hit> exact, std::span<const Hit> level, std::uint32_t width,
                         std::uint32_t height, float diagonal, HitDifferences* pool = nullptr);

/// Casts a camera's rays: width * height hits, row by row.
using CastView = std::function<std::vector<Hit>(const CameraRays&)>;

/// Compares views of one or more levels around `bounds`, which also gives the diagonal: one result per level.
/// `on_view`, where given, sees the hits.
std::vector<ViewsFidelity> measure_views(const CastView& exact, std::span<const CastView> levels,
                                         const Bounds3f& bounds, const ViewsConfig& config,
                                         const Progress& progress = {},
                                         const std::function<void(const MeasuredView&)>& on_view = {});

}  // namespace rbvh
