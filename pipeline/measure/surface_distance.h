// The distance between two surfaces, both ways, by sampling (Cignoni, Rocchini, Scopigno, "Metro: measuring
// error on simplified surfaces", 1998).
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/rbvh/rbvh.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

/// Corners of triangles, three after three.
using TriangleSoup = std::vector<Vec3f>;

/// A mesh's finite triangles, or a cloud's discs as octagons.
TriangleSoup surface_of(const Scan& scan);
/// What the tracer sees of a level: the texel quads of its tiles whose four corners have a surface without a
/// step between them, as two triangles each, as far as their middle lies in the leaf's box.
TriangleSoup surface_of(const Level& level);
/// Calls for each of those quads, tile by tile: its first texel's place in the tile and in the atlas. Not for
/// leaves that keep their primitives.
void for_each_quad(
    const Level& level,
    const std::function<void(std::uint32_t leaf, std::uint32_t x, std::uint32_t y, std::size_t texel)>& quad);

/// Answers "how far is the nearest point of the surface".
class ClosestPoint {
 public:
  explicit ClosestPoint(TriangleSoup triangles);
  /// +infinity for an empty surface.
  float distance(Vec3f point) const { return find(point).distance; }

  struct Nearest {
    float distance = std::numeric_limits<float>::infinity();
    std::uint32_t triangle = 0;  ///< of the soup
    Vec3f point{};
  };
  Nearest find(Vec3f point) const;

 private:
  struct Node {
    Bounds3f box;
    std::uint32_t first = 0, count = 0;  ///< count 0: children at first and first + 1
  };
  TriangleSoup triangles_;
  std::vector<std::uint32_t> order_;  ///< of triangles_, in the soup
  std::vector<Node> nodes_;
};

struct DistanceStatistics {
  double rms = 0, max = 0;  ///< scan units
};

/// From points spread evenly over `from` (by area, the same ones every time) to the surface `to`.
DistanceStatistics sampled_distance(const TriangleSoup& from, const ClosestPoint& to, std::size_t samples);

}  // namespace rbvh
