// Parameters of a build that users do not see.
#pragma once

#include "pipeline/rbvh/build.h"

namespace rbvh {

struct BuildTuning {
  float largest_tile = 0;  ///< side in texels; 0: optimal_resolution()
  bool one_sided =
      false;  ///< leaves of triangles, so that layers over their frames reach each (group_primitives.h)
};

/// build_rbvh() with other values for them.
Rbvh build_tuned(const Device& device, const Scan& scan, const BuildConfig& config, const BuildTuning& tuning,
                 const Progress& progress = {}, BuildTimings* timings = nullptr);

}  // namespace rbvh
