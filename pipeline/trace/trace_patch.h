// Ray casting proxies on the device without tessellating them: each patch's hierarchy is built when rays
// reach it, at the level of detail that is asked for, and kept in a bounded cache for other rays, bounces and
// frames. After Harada, "Rendering Vector Displacement Mapped Surfaces in a GPU Ray Tracer", GPU Pro 6.
//
// Nothing cracks: a patch's level holds for all rays of a cast, an edge that two patches share has the
// coarser one's level on both sides, and their vertices there are the same to the last bit; so all
// micro-quads together are one mesh, the one that tessellate() makes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "kernels/common/layout.h"
#include "kernels/common/patch_layout.h"
#include "pipeline/base/affine.h"
#include "pipeline/device/device.h"
#include "pipeline/proxy/patch_levels.h"
#include "pipeline/proxy/proxy.h"
#include "pipeline/trace/tracer.h"

namespace rbvh {

struct ProxyConfig {
  std::size_t cache_bytes = std::size_t{256} << 20;  ///< of hierarchies on the device at once
  bool keep = true;  ///< hierarchies stay for later casts; false, as in the source: each cast builds its own
  bool at_once =
      true;  ///< a ray meets a patch that is built as soon as it comes to it; false: always gathered
  bool packets = true;  ///< rays are cast 16 at a time, on a CPU: together where they stay so, else in turn
  bool atomics = true;  ///< nearest hits by 64-bit atomic minimum, where the device has it
  std::uint32_t few_rays = 4;  ///< so many rays meet a patch before it is built for them; 0: all are built
  std::uint32_t pairs =
      8;  ///< patches that a ray has built for it in a round, one in the first; at most kMostPairs
};
inline constexpr std::uint32_t kMostPairs = 8;

/// Where one of the proxies stands. Its patches are leaves first_leaf, first_leaf + 1 ... of hits.
struct ProxyInstance {
  std::uint32_t proxy = 0;
  Affine to_world;  ///< invertible
  std::uint32_t first_leaf = 0;
};

/// What was done, summed up since the tracer was made or reset_stats(). Seconds are measured only while
/// `timed` is set, as that waits for the device between phases.
struct ProxyStats {
  bool timed = false;
  double top = 0, sort = 0, build = 0, cast = 0;
  std::uint64_t rays = 0, rounds = 0, pairs = 0, jobs = 0;
  std::uint64_t built = 0, built_leaves = 0, built_bytes = 0, evicted = 0;
  std::uint64_t unbuilt_rays = 0;  ///< pairs with patches that were not built for them
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
  /// that the cache cannot hold is intersected unbuilt, which takes long; Error(kBudget) where the cache is
  /// too small even for the smallest.
  void intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count, RayQuery query,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  /// At that camera's detail.
  void intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  SurfaceSamples surface(std::span<const Hit> hits) const override { return geometric_surface(hits); }
  std::uint64_t memory() const override;
};

/// Of proxies without a find_fault(). Throws Error(kBudget) where the device cannot hold them. At first every
/// patch is at its finest.
PatchTracer make_patch_tracer(const Device& device, std::span<const Proxy* const> proxies,
                              std::span<const ProxyInstance> instances, const ProxyConfig& config = {});
PatchTracer make_patch_tracer(const Device& device, const Proxy& proxy, const ProxyConfig& config = {});

/// From now on micro-quads are about `pixels` pixels of that camera (0.7 to 1.4 times that in a patch's
/// nearest point), or the tiles' own where those are coarser. Rays of that camera that resolve less than the
/// patch's nearest do with less.
void set_detail(const PatchTracer& tracer, const CameraRays& camera, double pixels = 1);
/// Every patch at its finest, or at `most`.
void set_detail(const PatchTracer& tracer, std::uint32_t most = PATCH_MOST_LEVEL);
/// From now on every ray goes down to the micro-quads, whatever it resolves: for rays that are not the
/// camera's.
void resolve_everything(const PatchTracer& tracer);
/// The levels now in use, of one proxy.
std::vector<PatchLevel> levels_in_use(const PatchTracer& tracer, std::uint32_t proxy = 0);

/// Rays of an image, `row` pixels wide, row by row (0: any rays). Speed alone depends on it.
void intersect_rows(const PatchTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                    std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps, std::uint32_t row);
/// The same, starting from hits of other objects and their steps.
void intersect_further(const PatchTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                       std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps,
                       std::uint32_t row);

ProxyStats& stats(const PatchTracer& tracer);
ProxyBytes bytes(const PatchTracer& tracer);
/// Forgets all hierarchies.
void clear_cache(const PatchTracer& tracer);

}  // namespace rbvh
