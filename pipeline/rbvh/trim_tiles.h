// Which cells of overlapping tiles a mesh takes. (Turk & Levoy, "Zippered Polygon Meshes from Range Images",
// SIGGRAPH 1994: overlapping range images lose what is there twice, before they are joined.)
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

struct TrimmedTiles {
  /// For each texel of the level's atlas 1 where the quad that begins there (see for_each_quad()) lies on no
  /// primitive and on no quad of a lower leaf, else 0. Between what is left are gaps about a texel wide.
  std::vector<std::uint8_t> quads;
  /// For each vertex of the level's primitives the side of a texel (scan units) of a tile that it lies on; 0:
  /// it lies on none, and what ends there ends in the scan.
  std::vector<float> vertex_texels;
};

/// Of a mesh.
TrimmedTiles trim_tiles(const Level& level);

}  // namespace rbvh
