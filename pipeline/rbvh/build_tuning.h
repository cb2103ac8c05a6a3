// Parameters of a build that benchmarks vary and that have a best value.
#pragma once

#include "pipeline/rbvh/build.h"

namespace rbvh {

struct BuildTuning {
  float largest_tile = 0;  ///< side in texels; 0: optimal_resolution()
};

/// build_rbvh() with other values for them.
Rbvh build_tuned(const Device& device, const Scan& scan, const BuildConfig& config, const BuildTuning& tuning,
                 const Progress& progress = {}, BuildTimings* timings = nullptr);

}  // namespace rbvh
