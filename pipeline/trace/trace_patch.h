// Ray casting proxies on the device without tessellating them. A proxy is a displaced patch mesh: each
// patch's hierarchy is built when rays reach it, at the level of detail asked for, and kept in a bounded
// cache for other rays, bounces and frames. After Harada, "Rendering Vector Displacement Mapped Surfaces in a
// GPU Ray Tracer", GPU Pro 6.
//
// The surface has no cracks: a patch has one level for all rays of a cast, an edge that two patches share has
// the coarser one's level on both sides, and their vertices there are bitwise equal. All micro-quads together
// are the mesh that tessellate() makes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "kernels/common/layout.h"
#include "kernels/common/patch_layout.h"
#include "pipeline/device/device.h"
#include "pipeline/proxy/patch_levels.h"
#include "pipeline/proxy/proxy.h"
#include "pipeline/trace/patch_scene.h"
#include "pipeline/trace/surface.h"
#include "rbvh/tracer.h"

namespace rbvh {

struct ProxyConfig {
  std::size_t cache_bytes = std::size_t{256} << 20;  ///< of hierarchies on the device at once
  bool keep = true;  ///< hierarchies stay for later casts; false, as in the paper: each cast builds its own
  bool at_once = true;  ///< rays intersect a built patch as soon as they reach it; false: only as work items
  bool packets = true;  ///< on a CPU rays are cast 16 at a time: coherent ones together, others interleaved
  std::uint32_t few_rays = 4;  ///< so many rays are cast at a patch before it is built for them; 0: none
  std::uint32_t items = 8;     ///< work items of a ray in a round, one in the first; at most kMostItems
};
inline constexpr std::uint32_t kMostItems = 8;

/// What was done, summed up since the tracer was made or its stats were set to {}. Seconds are measured only
/// while `timed` is set, as that waits for the device between phases.
struct ProxyStats {
  bool timed = false;
  double top = 0, sort = 0, build = 0, cast = 0;
  std::uint64_t rays = 0, rounds = 0, items = 0, jobs = 0;  ///< items: work items of ray and patch
  std::uint64_t built = 0, built_leaves = 0, built_bytes = 0, evicted = 0;
  std::uint64_t unbuilt_rays = 0;  ///< work items at patches that were not built for them
};

struct ProxyBytes {
  std::size_t base = 0;  ///< base quads, instances, bounds, top and middle hierarchy
  std::size_t maps = 0;
  std::size_t cache = 0;   ///< its limit
  std::size_t cached = 0;  ///< hierarchies in it now
};

struct PatchTracerState;

/// Proxies on the device. Cheap to copy; copies share the cache and the levels of detail. Not to be used from
/// several threads at once.
struct PatchTracer final : Tracer {
  std::shared_ptr<PatchTracerState> state;

  using Tracer::Tracer;
  /// Hit.u and v are s and t in the patch; leaf is the patch. `steps` counts nodes and micro-quads. A patch
  /// that the cache cannot hold is intersected unbuilt, which is slow; Error(kBudget) where it is too coarse
  /// for that.
  void intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count, RayQuery query,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  /// At that camera's detail.
  void intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  SurfaceSamples surface(std::span<const Hit> hits, float) const override { return geometric_surface(hits); }
  std::uint64_t memory() const override;
};

/// Of proxies without a find_fault(). Throws Error(kBudget) where the device cannot hold them. At first every
/// patch is at its finest.
PatchTracer make_patch_tracer(const Device& device, std::span<const Proxy* const> proxies,
                              std::span<const ProxyInstance> instances, const ProxyConfig& config = {});
PatchTracer make_patch_tracer(const Device& device, const Proxy& proxy, const ProxyConfig& config = {});

/// From now on micro-quads measure about `pixels` pixels of that camera (0.7 to 1.4 times that in a patch's
/// nearest point), or are the tiles' own where those are coarser. A ray of that camera takes boxes for the
/// surface where it resolves less than the patch's nearest point does.
void set_detail(const PatchTracer& tracer, const CameraRays& camera, double pixels = 1);
/// Every patch at its finest, or at `most`.
void set_detail(const PatchTracer& tracer, std::uint32_t most = PATCH_MOST_LEVEL);
/// From now on every ray intersects micro-quads, whatever it resolves: for rays other than the camera's.
void resolve_everything(const PatchTracer& tracer);
/// The levels now in use, of one proxy.
std::vector<PatchLevel> levels_in_use(const PatchTracer& tracer, std::uint32_t proxy = 0);

/// Rays of an image, `row` pixels wide, row by row (0: any rays). Only speed depends on it.
void intersect_rows(const PatchTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                    std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps, std::uint32_t row);
/// The same, starting from hits of other objects and from their steps.
void intersect_further(const PatchTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                       std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps,
                       std::uint32_t row);

ProxyStats& stats(const PatchTracer& tracer);
ProxyBytes bytes(const PatchTracer& tracer);
/// Drops all hierarchies.
void clear_cache(const PatchTracer& tracer);

}  // namespace rbvh
