// Decimation by quadric error (Garland and Heckbert, "Surface Simplification Using Quadric
// Error Metrics", SIGGRAPH 1997; OpenMesh's quadrics and half-edges). Each step is recorded as a map, so that
// every point of the result has its point on the original.
#pragma once

#include <limits>
#include <memory>

#include "pipeline/base/progress.h"
#include "pipeline/proxy/manifold.h"
#include "pipeline/proxy/self_map.h"

namespace rbvh {

/// A decimated mesh.
struct BaseMesh {
  std::vector<Vec3f> positions;  ///< a subset of the original's
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t>
      versions;  ///< of each triangle: with weights in its corners' order, SelfMap's FacePoint
};

class Decimation {
 public:
  /// Throws Error(kInput) for a mesh that half-edges cannot hold; make_manifold() gives none. `file` is for
  /// messages.
  Decimation(const Manifold& mesh, const std::string& file);
  ~Decimation();
  Decimation(const Decimation&) = delete;
  Decimation& operator=(const Decimation&) = delete;

  /// Stops when at most `triangles` are left, when each further step would move the surface by more than
  /// `max_error` scan units (root mean square over a vertex's area), or when no step is legal. Keeps shape
  /// and orientation of triangles while that leaves legal steps.
  void run(std::uint64_t triangles, double max_error, const Progress& progress);

  std::uint64_t triangle_count() const;
  BaseMesh base() const;
  /// Moves the map out and frees everything else; no other member may be called afterwards.
  SelfMap finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace rbvh
