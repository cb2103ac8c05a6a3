// Fewer or coarser levels of a pair: chosen by bytes, or built from a finer level's surface where the scan is
// not at hand.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// The level's surface, as rays intersect it, as a scan: of a mesh two triangles for each quad of texels and
/// the exact triangles; of a cloud a disc for each texel and the exact discs. With normals and, where the
/// level has them, colours.
Scan scan_of_level(const Level& level, bool is_cloud);

/// Builds levels from the surface of `from`, as build_rbvh() does from a scan. (Mip levels of its tiles would
/// leave a coarse level with the fine one's many leaves: section 3.5 of the paper prefers a rebuild.)
/// They are marked as derived, are not measured, and have the user's layers too.
std::vector<Level> derive_levels(const Device& device, const Rbvh& rbvh, const Level& from,
                                 const std::vector<LevelConfig>& levels, const Progress& progress = {});

/// The finest set that fits, greedily: from the front, each level that still fits beside those already
/// chosen. `bytes` of each, finest first; the indices are in that order.
std::vector<std::size_t> choose_levels_by_bytes(std::span<const std::uint64_t> bytes, std::uint64_t most);

}  // namespace rbvh
