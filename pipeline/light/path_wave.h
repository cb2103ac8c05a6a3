// Paths in waves: all that are under way take their next step together, so that rays are cast in large
// batches. Shading is on the host's threads, as surfaces' attributes are.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/base/stopwatch.h"
#include "pipeline/light/environment.h"
#include "pipeline/light/ray_batch.h"

namespace rbvh {

inline constexpr std::size_t kPathsAtOnce = std::size_t{1} << 19;
inline constexpr std::size_t kPathGrain = 1 << 12;  ///< of parallel_for()

/// A path between two of its vertices.
struct Path {
  Vec3f throughput{1, 1, 1};
  float pdf = 0;            ///< of the ray's direction; only where it is not a mirror's
  std::uint32_t pixel = 0;  ///< or point
  float ground = 0;         ///< t of the ground that its ray met; 0: it met the surface
  bool is_mirror = true;    ///< camera rays too: lights are not sampled towards them
  bool on_ground = false;   ///< the first vertex is on the ground, which only catches shadows
};

/// Sums over the samples of a pixel.
struct Sums {
  Vec3f direct{}, indirect{}, albedo{}, normal{};
  float depth = 0, covered = 0;  ///< t of the object's hits; how many
  float lit = 0;                 ///< luminance of direct light, were nothing in its way
  float ground_lit = 0, ground_direct = 0, ground = 0;  ///< the same where the ground is seen; how often
  float squares = 0;                                    ///< of the samples' luminance
  float sample = 0;                                     ///< luminance of the sample under way
};

/// What a wave of paths needs. Kept from wave to wave: memory that is new to the process costs time.
struct Wave {
  std::vector<Path> paths;
  std::vector<Ray> rays;  // that led to the hits
  std::vector<Hit> hits;
  std::vector<Ray> shadow_rays;
  std::vector<Vec3f> shadow_light;  // what arrives where nothing is in the way
  std::vector<std::uint32_t> shadow_paths;
  std::vector<Path> next_paths;
  std::vector<Ray> next_rays;
  RayBatch batch;
};

/// Paths of one picture, or from one set of points.
struct PathTrace {
  const Tracer& primary;
  const Tracer& secondary;
  const EnvironmentSampler& environment;
  const PathConfig& config;
  std::vector<Sums> sums{};
  Wave wave{};
  bool from_points = false;  ///< a path's first vertex is a white, matte point, whatever the material
  std::uint64_t cast = 0;    ///< rays
  double trace_seconds = 0, shade_seconds = 0;
  Stopwatch watch{};
};

/// Removes what is inactive from pairs of rays and paths; in order.
template <class Other>
void keep_active(std::vector<Ray>& rays, std::vector<Other>& others) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (rays[i].tmax < 0) continue;
    rays[kept] = rays[i];
    others[kept++] = others[i];
  }
  rays.resize(kept);
  others.resize(kept);
}

/// Path.ground of a ray, whose hit is then none.
float find_ground(const PathTrace& trace, const Ray& ray, Hit& hit);

/// One step of all paths of the wave: light at their vertices, and the rays to the next ones. `bounce` counts
/// from 1.
void step(PathTrace& trace, const SurfaceSamples& surface, int sample, int bounce);

}  // namespace rbvh
