// Exact ray casting of a scan's triangles or discs on the device: the picture everything else is compared
// with. Any builder's tree, flattened for any traversal that fits it; all find the same hits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "kernels/bvh/bvh_layout.h"
#include "kernels/common/layout.h"
#include "pipeline/bvh/exact_methods.h"
#include "pipeline/device/device.h"
#include "pipeline/trace/disc_surface.h"
#include "pipeline/trace/surface.h"
#include "rbvh/scan.h"
#include "rbvh/tracer.h"

namespace rbvh {

struct ExactConfig {
  ExactTraversal traversal = ExactTraversal::kWide16;
  ExactBuilder builder = ExactBuilder::kSahBinned;  ///< of the kind of tree that the traversal takes
};

/// A scan in the traversal's own layout. Cheap to copy.
struct ExactTracer final : Tracer {
  std::string kernel, options;  ///< file, and -D words
  BvhRoot scene{};
  Buffer<std::uint32_t> nodes, primitives;  ///< the kernel's own structs
  Buffer<std::uint32_t> references;         ///< kd-trees only
  /// Cameras of at least so many pixels have their rays cast in beams, of fewer in groups of 16, as other
  /// rays are. 0: all are cast one by one.
  std::size_t beam_pixels = 0;
  std::size_t node_bytes() const { return nodes.size() * sizeof(std::uint32_t); }
  std::size_t primitive_bytes() const {
    return (primitives.size() + references.size()) * sizeof(std::uint32_t);
  }

  const Scan* scan = nullptr;
  /// For shading, made when first wanted: of a mesh, and of a cloud.
  mutable std::shared_ptr<const ShadingNormals> normals;
  mutable std::shared_ptr<const DiscSurface> discs;
  mutable std::shared_ptr<const TextureSampler> textures;

  using Tracer::Tracer;
  /// Hit.leaf is the triangle's or point's index in the scan; of several at the same t the lowest. A
  /// triangle's u and v weigh its second and third vertex. `steps` counts nodes and primitives (wide16:
  /// blocks of them).
  void intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count, RayQuery query,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  /// In beams `steps` are what the ray's beam visited.
  void intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                 const Buffer<std::uint32_t>* steps = nullptr) const override;
  SurfaceSamples surface(std::span<const Hit> hits, float spread) const override;
  std::uint64_t memory() const override { return node_bytes() + primitive_bytes(); }
};

/// Seconds by phase, and how good the tree is.
struct ExactTimings {
  double hierarchy = 0, flatten = 0, upload = 0;
  double sah_cost = 0;  ///< what a ray is expected to pay, by the costs the tree was built with
};

/// A cloud needs normals and radii, and a traversal that takes discs (Error(kUsage)). Primitives that are not
/// finite, triangles without area, discs without a normal or radius are never hit. Throws Error(kBudget) when
/// the device cannot hold it.
ExactTracer make_exact_tracer(const Device& device, const Scan& scan, const ExactConfig& config = {},
                              ExactTimings* timings = nullptr);

/// What `count` rays visit on average.
struct ExactVisits {
  double nodes = 0, primitives = 0;  ///< wide16: blocks of primitives
};
ExactVisits mean_visits(const ExactTracer& tracer, const Buffer<Ray>& rays, std::size_t count,
                        RayQuery query);

}  // namespace rbvh
