// A smaller set of levels out of those that are there: chosen by bytes, or built anew from a finer level's
// own surface where the scan is not at hand.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// What rays see of the level, as a scan: of a mesh its texels' quads as triangles and the triangles that
/// leaves keep; of a cloud a disc for each texel and the discs that leaves keep. With normals and, where the
/// level has them, colours.
Scan scan_of_level(const Level& level, bool is_cloud);

/// Builds levels from the surface of `from` as build_rbvh() builds them from a scan. (Mip levels of its tiles
/// would leave a coarse level the fine one's many leaves: section 3.5 of the paper calls a rebuild better.)
/// They say that they are derived, are not measured, and have the user's layers, too.
std::vector<Level> derive_levels(const Device& device, const Rbvh& rbvh, const Level& from,
                                 const std::vector<LevelConfig>& levels, const Progress& progress = {});

/// The finest set that fits: taken from the front, each that still fits beside those already taken. `bytes`
/// of each, finest first; indices come back in that order.
std::vector<std::size_t> choose_levels_by_bytes(std::span<const std::uint64_t> bytes, std::uint64_t most);

}  // namespace rbvh
