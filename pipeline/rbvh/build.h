// From a scan to a rasterized BVH. A level of tiles: partition (once for all of these), rasterise, refine,
// assemble. A level of primitives: simplify, group, assemble.
#pragma once

#include <cstdint>
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

/// Throws Error(kInput) for a scan that build_rbvh() cannot take: with positions that are not finite, or a
/// cloud without normals or radii. `file` is for messages.
void check_buildable(const Scan& scan, const std::string& file);

/// About how many bytes a build has in memory at its peak.
std::uint64_t build_memory(const Scan& scan, const BuildConfig& config);

/// The scan must pass check_buildable(). Deterministic for one device.
/// Throws Error(kInput) for a scan whose area is zero or beyond what float can work with, Error(kBudget)
/// where a level needs too many texels.
Rbvh build_rbvh(const Device& device, const Scan& scan, const BuildConfig& config,
                const Progress& progress = {}, BuildTimings* timings = nullptr);

}  // namespace rbvh
