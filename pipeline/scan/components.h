// Removes connected components of a scan that are much smaller than the rest.
#pragma once

#include <cstddef>

#include "pipeline/scan/scan.h"

namespace rbvh {

/// Removed elements.
struct ComponentCounts {
  std::size_t components = 0;
  std::size_t vertices = 0;
  std::size_t faces = 0;
};

/// Removes connected components with fewer than `fraction` of all faces (points of a cloud). Faces are
/// connected by corners at the same position, points by discs that touch: a cloud needs normals and radii.
/// Needs finite positions.
ComponentCounts remove_small_components(Scan& scan, double fraction);

}  // namespace rbvh
