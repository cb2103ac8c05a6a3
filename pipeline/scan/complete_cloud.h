// Makes a cloud of points one of oriented discs: normals, consistently oriented, and radii where they are
// missing.
#pragma once

#include <cstddef>
#include <optional>

#include "pipeline/base/progress.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

struct CloudConfig {
  std::size_t neighbors = 16;  ///< from which normals and radii are estimated; at least 3
  std::optional<Vec3d>
      viewpoint;  ///< where the sensor stood, in the scan's (shifted) coordinates; overrides the file's
};

/// Numbers of completed points.
struct CloudCounts {
  std::size_t normals_estimated = 0;
  std::size_t normals_by_viewpoint =
      0;  ///< of these, oriented towards a viewpoint; the others by propagation
  std::size_t radii_estimated = 0;
};

/// Normals and radii that are there and usable stay. Points that are not finite get a zero normal and radius.
/// A file's viewpoint that is the default one is used only if the points can have been seen from there.
/// Deterministic for any number of threads. Does nothing to a mesh.
CloudCounts complete_cloud(Scan& scan, const CloudConfig& config, const Progress& progress = {});

}  // namespace rbvh
