// What rays are cast at: a scan's primitives, one level of a pair or all of them, proxies, a scene. One
// virtual call a batch; the kernels behind it are specialised.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "rbvh/device.h"
#include "rbvh/geometry.h"
#include "rbvh/ray.h"

#pragma GCC visibility push(default)
namespace rbvh {

struct Asset;

/// What surfaces without colours are made of, in linear light.
inline constexpr Vec3f kClay{0.50f, 0.455f, 0.41f};

/// The surface at each hit, in their order. Colours are linear light; empty: kClay.
struct SurfaceSamples {
  std::vector<Vec3f> normals;  ///< smooth, unit, unflipped; zero where nothing is hit
  std::vector<Vec3f> colors;
};

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

  /// Smooth normals and colours at hits of this tracer. `spread`: the rays' width over their length, over
  /// which textures are averaged; 0: they are not.
  virtual SurfaceSamples surface(std::span<const Hit> hits, float spread) const = 0;

  /// Bytes on the device, caches at their limit.
  virtual std::uint64_t memory() const = 0;

  /// Whether parts of it are read while it is cast: few large batches are better than many small ones.
  virtual bool is_on_demand() const { return false; }

 protected:
  Tracer(const Tracer&) = default;
  Tracer& operator=(const Tracer&) = default;
  Tracer(Tracer&&) = default;
  Tracer& operator=(Tracer&&) = default;
};

/// How an asset is traced.
struct TracerConfig {
  /// A pair's level, such as "Q2"; empty: the finest; "auto": for each ray the coarsest level whose texels it
  /// covers. Ignored for other assets.
  std::string level;
  float spread = 0;  ///< of "auto": the width of rays that are not a camera's over their length
  /// Of scans, by name, such as "bvh-trail" and "lbvh"; empty: wide nodes, and the first builder that fits.
  std::string traversal, builder;
  std::uint64_t patch_cache_bytes = 256u << 20;  ///< of proxies' hierarchies on the device at once
  double pixels = 1;                             ///< of a camera, that a proxy's micro-quad measures
};

/// `asset` must outlive the tracer. Throws Error(kUsage) for a level or method that is not there,
/// Error(kBudget) where the device cannot hold it.
std::unique_ptr<Tracer> make_tracer(const Device& device, const Asset& asset,
                                    const TracerConfig& config = {});

/// Casts rays in batches that fit the device; as many steps where asked for.
std::vector<Hit> intersect(const Tracer& tracer, std::span<const Ray> rays,
                           RayQuery query = RayQuery::kNearest, std::vector<std::uint32_t>* steps = nullptr);

/// Casts a camera's rays in bands that fit the device: width * height hits, row by row.
std::vector<Hit> intersect(const Tracer& tracer, const CameraRays& camera,
                           std::vector<std::uint32_t>* steps = nullptr);

/// For each ray 1 where anything lies in its interval, else 0.
std::vector<std::uint8_t> occluded(const Tracer& tracer, std::span<const Ray> rays);

}  // namespace rbvh
#pragma GCC visibility pop
