// From a scan to a rasterized BVH: partition, rasterise, refine, pack; one full rebuild per level.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/device/device.h"
#include "pipeline/rbvh/focus.h"
#include "pipeline/rbvh/leaf_policy.h"
#include "pipeline/rbvh/partition.h"
#include "pipeline/rbvh/rbvh.h"
#include "rbvh/build.h"
#include "rbvh/progress.h"
#include "rbvh/scan.h"

namespace rbvh {

/// The scan must have finite positions only; a cloud needs normals and radii. Deterministic for one device.
/// Throws Error(kInput) for a scan whose area is zero or beyond what float can work with, Error(kBudget)
/// where a level needs too many texels.
Rbvh build_rbvh(const Device& device, const Scan& scan, const BuildConfig& config,
                const Progress& progress = {}, BuildTimings* timings = nullptr);

}  // namespace rbvh
