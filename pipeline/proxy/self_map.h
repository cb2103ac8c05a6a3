// A map from a decimated mesh back to the mesh it came from, one-to-one and onto: successive self-
// parametrisation (Lee et al., "MAPS: Multiresolution Adaptive Parameterization of Surfaces", SIGGRAPH 1998;
// the composition of local maps as in Liu et al., "Neural Subdivision", SIGGRAPH 2020).
//
// Each removed vertex is a step. Its star and the fan of triangles that takes its place are two
// triangulations of one polygon in the plane, so a point of the fan lies in exactly one triangle of the star:
//
//        r2 ---- r1                r2 ---- r1
//       /  \    /  \              /  \__     \          steps compose; on the polygon's boundary every step
//       is the
//     r3 -- v0 -- r0     <->    r3 ----- \-- r0        identity, so the whole is continuous
//       \  /    \  /              \    __ /  /
//        r4 ---- r5                r4 ---- r5
//
// A triangle at any step is a *face version*: the original mesh's keep their numbers, and each step adds
// those of its fan.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/base/vec.h"

namespace rbvh {

/// A point in a triangle: barycentric coordinates in the order of the version's corners.
struct FacePoint {
  std::uint32_t version = 0;
  std::array<double, 3> weights{};
};

/// A triangle of the star of a vertex to be removed: its version, and which of that version's corners
/// (0 to 2) the vertex is.
struct StarFace {
  std::uint32_t version = 0, corner_of_center = 0;
};

class SelfMap {
 public:
  /// Over a mesh of `triangles` triangles.
  explicit SelfMap(std::uint32_t triangles) : originals_(triangles) {}

  /// Removes a vertex at `center`. `ring` are its neighbours counter-clockwise; `star` the triangles
  /// (center, ring[i], ring[i + 1]): as many as the ring has vertices, or one less for a vertex on the mesh's
  /// boundary, whose first and last neighbours then lie on it too. The fan goes out from ring[fan_from]: 0,
  /// or on the boundary also the last. Returns the first of ring.size() - 2 new versions: triangles
  /// (fan_from, i, i + 1), corners in this order, for all i without fan_from, in increasing order.
  std::uint32_t remove_vertex(Vec3d center, std::span<const Vec3d> ring, std::span<const StarFace> star,
                              std::uint32_t fan_from);

  /// Whether remove_vertex() of a vertex inside the mesh could lay the star flat as it is, with no triangle
  /// of the fan flatter than `least_area` (twice the area over the square of the star's mean radius).
  static bool lies_flat(Vec3d center, std::span<const Vec3d> ring, bool is_boundary, std::uint32_t fan_from,
                        double least_area);

  /// The point of the original mesh. Safe to call from several threads.
  FacePoint to_original(FacePoint point) const;

  std::uint32_t version_count() const { return originals_ + static_cast<std::uint32_t>(step_of_.size()); }
  /// Steps whose star could not be flattened without a fold and was laid on a circle instead.
  std::uint64_t circle_steps() const { return circle_steps_; }
  std::uint64_t bytes() const;

 private:
  struct Point2 {
    float x = 0, y = 0;
  };
  struct Step {
    std::uint64_t first_ring = 0;  ///< in ring_
    std::uint64_t first_star = 0;  ///< in star_
    std::uint32_t first_version = 0;
    std::uint16_t ring_size = 0;
    bool is_boundary = false, fans_from_last = false;
  };

  std::uint32_t originals_;
  std::uint64_t circle_steps_ = 0;
  std::vector<Step> steps_;
  std::vector<Point2> ring_;            ///< the center lies at 0, 0
  std::vector<std::uint32_t> star_;     ///< version
  std::vector<std::uint8_t> corner_;    ///< of star_'s versions that is the center
  std::vector<std::uint32_t> step_of_;  ///< of each version after the originals
};

}  // namespace rbvh
