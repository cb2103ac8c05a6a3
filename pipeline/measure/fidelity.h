// How far an RBVH level is from the scan it was made of, seen: exact and level hits of the same rays
// compared, in views around the object. (Distances between the surfaces themselves: surface_distance.h.)
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/base/progress.h"
#include "pipeline/render/camera.h"

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

/// Middle and tail of a set of errors, by nearest rank. All NaN for an empty set.
struct Distribution {
  double median = 0, p95 = 0, p99 = 0, p999 = 0, max = 0;
};
/// Reorders `values`.
Distribution distribution(std::vector<float>& values);

/// One view, or all views together (counts added up, distributions over all pixels).
struct HitFidelity {
  std::uint64_t pixels = 0;  ///< that the exact tracer hits
  std::uint64_t holes = 0, leaks = 0, walls = 0;
  std::uint64_t mismatches = 0;     ///< pixels where one of the two hits
  std::uint64_t at_silhouette = 0;  ///< of these, within 1 pixel of the exact silhouette
  Distribution dt;                  ///< |t difference| / diagonal where both hit
  Distribution normal_degrees;      ///< angle between the geometric normals where both hit

  double mismatch_percent() const {
    return pixels ? 100.0 * static_cast<double>(mismatches) / static_cast<double>(pixels) : 0;
  }
  double silhouette_percent() const {
    return mismatches ? 100.0 * static_cast<double>(at_silhouette) / static_cast<double>(mismatches) : 0;
  }
};

/// Differences of a view's pixels, kept so that views can be pooled.
struct HitDifferences {
  std::vector<float> dt, degrees;
};

/// Compares one view; appends its differences to `pool` where given.
HitFidelity compare_hits(std::span<const Hit> exact, std::span<const Hit> level, std::uint32_t width,
                         std::uint32_t height, float diagonal, HitDifferences* pool = nullptr);

/// Casts a camera's rays: width * height hits, row by row.
using CastView = std::function<std::vector<Hit>(const CameraRays&)>;

struct ViewsConfig {
  int views = 8;
  std::uint32_t resolution = 1024;  ///< both ways
  Vec3d up_axis{0, 1, 0};
};

/// A view of one level as measure_views() hands it on, for pictures.
struct MeasuredView {
  std::size_t level;
  int view;
  const Camera& camera;
  const CameraRays& rays;
  std::span<const Hit> exact, hits;
  const HitFidelity& fidelity;
};

struct ViewsFidelity {
  std::vector<HitFidelity> views;
  HitFidelity all;
  std::uint64_t worst_holes = 0, worst_leaks = 0, worst_walls = 0;  ///< of one view
};

/// Compares views of one or more levels around `bounds`, which also gives the diagonal: one result per level.
/// `on_view`, where given, sees the hits.
std::vector<ViewsFidelity> measure_views(const CastView& exact, std::span<const CastView> levels,
                                         const Bounds3f& bounds, const ViewsConfig& config,
                                         const Progress& progress = {},
                                         const std::function<void(const MeasuredView&)>& on_view = {});

}  // namespace rbvh
