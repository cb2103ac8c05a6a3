// Levels for tests, of tiles alone unless told.
#pragma once

#include <utility>
#include <vector>

#include "pipeline/device/device.h"
#include "pipeline/rbvh/build.h"

namespace rbvh {

inline Rbvh build(const Scan& scan, std::vector<LevelConfig> levels,
                  Refinement refinement = Refinement::kProjectedArea, Hybrid hybrid = Hybrid::kOff) {
  return build_rbvh(Device::open(), scan,
                    BuildConfig{.levels = std::move(levels), .refinement = refinement, .hybrid = hybrid});
}

}  // namespace rbvh
