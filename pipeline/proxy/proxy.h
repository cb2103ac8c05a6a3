// A proxy is a displaced patch mesh: patches, each a base quad with its own square tile of displacement
// vectors. Whether baked here or read from a foreign quad mesh with any map, in memory it is always this.
//
//   position(s, t) of a patch = bilinear(corners, s, t) + bilinear(its tile's texels, s, t)
//
// Texels sit at the corners of micro-quads: texel (0,0) at the quad's first corner, (side-1,0) at its second,
// (side-1,side-1) at its third. Patches that share an edge hold bitwise equal surface points along it; where
// their sides differ, the finer one's points in between lie on the coarser one's chord: the surface has no
// cracks.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "pipeline/base/vec.h"

namespace rbvh {

using Quad = std::array<std::uint32_t, 4>;  ///< vertex indices, counter-clockwise seen from outside

/// Where a patch's texels lie in the map.
struct PatchTile {
  std::uint32_t x = 0, y = 0;      ///< its first texel
  std::uint32_t side = 2;          ///< texels a side: 2^level + 1
  float longest_displacement = 0;  ///< of its texels, in scan units
};

struct Proxy {
  std::vector<Vec3f> positions;  ///< the base mesh's vertices, in scan units
  std::vector<Quad> quads;
  std::vector<PatchTile> tiles;                 ///< one per quad
  std::uint32_t map_width = 0, map_height = 0;  ///< in texels
  std::vector<Vec3f> map;                       ///< displacement in object space and scan units, row by row
};

}  // namespace rbvh
