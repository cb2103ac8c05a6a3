// Range images to one mesh, the way scanned models are made: their signed distances are averaged on a sparse
// grid (Curless & Levoy, SIGGRAPH 1996) and the zero surface is drawn with one vertex a cell (surface nets;
// Gibson, MICCAI 1998). What no view measured stays open.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "range_camera.h"
#include "rbvh/geometry.h"

namespace rbvh::demo {

struct FusedMesh {
  std::vector<Vec3f> positions;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// `cell` is the grid's spacing in scan units; surfaces thinner than about six cells get holes. The result
/// depends on nothing but the arguments.
FusedMesh fuse_range_images(const std::vector<RangeImage>& images, float cell);

}  // namespace rbvh::demo
