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

/// Notes which of a mesh's triangles are a fan of four corners or more: (c0 c1 c2), (c0 c2 c3), ...
class Fans {
 public:
  /// The last `count` of `end` triangles are one.
  void add(std::size_t end, std::size_t count) {
    if (count > 1) fans_.push_back({end - count, count});
  }

  /// Cuts again those that are concave or have corners on a straight line. Polygons whose edges cross, or of
  /// too many corners, are counted in `notes`, and stay as good as they are. `textures`: the triangles' own,
  /// or empty.
  void cut_again(std::span<const Vec3d> positions, std::vector<Triangle>& triangles,
                 std::vector<std::string>& notes, std::span<FaceTexture> textures = {}) const;

 private:
  struct Fan {
    std::size_t first, count;
  };
  std::vector<Fan> fans_;
};

}  // namespace rbvh
