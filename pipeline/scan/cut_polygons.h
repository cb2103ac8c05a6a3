// Polygons as triangles. Readers cut every polygon as a fan while they do not know all vertices yet; here
// those are cut again that a fan does not fill: by ears (Meisters 1975), in the plane of Newell's normal.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// Polygons that stay as good as they are.
struct PolygonFaults {
  std::size_t crossing = 0;  ///< whose edges cross
  std::size_t too_many = 0;  ///< concave ones, of too many corners
};
void add_notes(const PolygonFaults& faults, std::vector<std::string>& notes);

/// Notes which of a mesh's triangles are a fan of four corners or more: (c0 c1 c2), (c0 c2 c3), ...
class Fans {
 public:
  /// The last `count` of `end` triangles are one.
  void add(std::size_t end, std::size_t count) {
    if (count > 1) fans_.push_back({end - count, count});
  }

  bool empty() const { return fans_.empty(); }

  /// Cuts again those that are concave or have corners on a straight line. `textures`: the triangles' own, or
  /// empty.
  PolygonFaults cut_again(std::span<const Vec3d> positions, std::vector<Triangle>& triangles,
                          std::span<FaceTexture> textures = {}) const;

 private:
  struct Fan {
    std::size_t first, count;
  };
  std::vector<Fan> fans_;
};

}  // namespace rbvh
