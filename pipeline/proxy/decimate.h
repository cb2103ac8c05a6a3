// Fewer and fewer triangles by quadric error (Garland and Heckbert, "Surface Simplification Using Quadric
// Error Metrics", SIGGRAPH 1997; OpenMesh's quadrics and half-edges), each step kept as a map, so that every
// point of the result has its point on the original.
#pragma once

#include <limits>
#include <memory>

#include "pipeline/base/progress.h"
#include "pipeline/proxy/manifold.h"
#include "pipeline/proxy/self_map.h"

namespace rbvh {

/// What is left of a mesh.
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

  /// Goes on until at most `triangles` are left, or until each further step would move the surface by more
  /// than `max_error` scan units (root mean square over what a vertex stands for), or until nothing can go
  /// any more. Shape and orientation of triangles are kept as long as that leaves steps to take.
  void run(std::uint64_t triangles, double max_error, const Progress& progress);

  std::uint64_t triangle_count() const;
  BaseMesh base() const;
  /// The map, taken out; the rest is given back to the machine, and nothing else may be asked any more.
  SelfMap finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace rbvh
