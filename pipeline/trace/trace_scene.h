// Ray casting a scene on the device: each instance's rays are cast in its own space by the tracer of its
// object, and all proxies together, as their top hierarchy is over instances. A ray keeps its nearest hit.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "pipeline/scene/scene.h"
#include "pipeline/trace/trace_exact.h"
#include "pipeline/trace/trace_patch.h"
#include "pipeline/trace/trace_tile.h"
#include "rbvh/tracer.h"

namespace rbvh {

struct SceneConfig {
  ExactConfig exact;
  ProxyConfig proxy;
  double pixels = 1;  ///< a proxy's micro-quad measures in a camera's picture
};

struct SceneTracerState;

/// A scene on the device. Cheap to copy; copies share the cache of patch hierarchies. Not to be used from
/// several threads at once.
struct SceneTracer final : Tracer {
  std::shared_ptr<SceneTracerState> state;

  using Tracer::Tracer;
  /// Hit.leaf numbers the leaves of all instances through (first_leaves()); proxies are at their finest.
  void intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count, RayQuery query,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  /// Proxies are at that camera's detail.
  void intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  /// By each object's own normals and colours.
  SurfaceSamples surface(std::span<const Hit> hits, float spread) const override;
  std::uint64_t memory() const override;
  bool is_on_demand() const override;
};

/// Throws as the tracers of its objects do.
SceneTracer make_scene_tracer(const Device& device, const Scene& scene, const SceneConfig& config = {});

/// How the scene's proxies were traced; nullptr without any.
const PatchTracer* patch_tracer(const SceneTracer& tracer);

}  // namespace rbvh
