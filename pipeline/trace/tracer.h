// What rays are cast at: a scan's primitives, one level of a pair or all of them, proxies, a scene. One
// virtual call a batch; the kernels behind it are specialised.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/device/device.h"
#include "pipeline/trace/surface.h"

namespace rbvh {

enum class RayQuery { kNearest, kAny };

/// A surface on the device. Not to be used from several threads at once. The data that it was made of must
/// outlive it where surface() is called.
struct Tracer {
  Device device;

  Tracer() = default;  ///< casts nothing
  explicit Tracer(Device on) : device(std::move(on)) {}
  virtual ~Tracer() = default;

  /// Nearest (or any) hits of `count` rays, in their order, t in [tmin, tmax]. Hit.leaf numbers the surface's
  /// tiles, primitives or patches. `steps`, where given, gets the nodes, texels and primitives visited per
  /// ray. Enqueued: wait for the device, or read the buffer, before anything else.
  virtual void intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
                         RayQuery query = RayQuery::kNearest,
                         const Buffer<std::uint32_t>* steps = nullptr) const = 0;

  /// Primary rays of a camera: width * height hits, row by row.
  virtual void intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                         const Buffer<std::uint32_t>* steps = nullptr) const = 0;

  /// Smooth normals and colours at hits of this tracer.
  virtual SurfaceSamples surface(std::span<const Hit> hits) const = 0;

  /// Bytes on the device, caches at their limit.
  virtual std::uint64_t memory() const = 0;

 protected:
  Tracer(const Tracer&) = default;
  Tracer& operator=(const Tracer&) = default;
  Tracer(Tracer&&) = default;
  Tracer& operator=(Tracer&&) = default;
};

/// Casts rays in batches that fit the device; as many steps where asked for.
std::vector<Hit> intersect(const Tracer& tracer, std::span<const Ray> rays,
                           RayQuery query = RayQuery::kNearest, std::vector<std::uint32_t>* steps = nullptr);

/// Casts a camera's rays in bands that fit the device: width * height hits, row by row.
std::vector<Hit> intersect(const Tracer& tracer, const CameraRays& camera,
                           std::vector<std::uint32_t>* steps = nullptr);

/// For each ray 1 where anything lies in its interval, else 0.
std::vector<std::uint8_t> occluded(const Tracer& tracer, std::span<const Ray> rays);

}  // namespace rbvh
