// Rasterises the leaves of a level and refines them: a leaf whose tile is a poor fit is split or holds
// its primitives, until all are good or small.
#pragma once

#include <vector>

#include "pipeline/base/stopwatch.h"
#include "pipeline/rbvh/level_rule.h"
#include "pipeline/rbvh/partition.h"
#include "pipeline/rbvh/primitives.h"
#include "pipeline/rbvh/tile.h"

namespace rbvh {

struct RefinedLevel {
  std::vector<Tile> tiles;
  TileTexels texels;
  /// Of each tile that holds primitives: the scan's.
  std::vector<std::vector<std::uint32_t>> held;
};

/// `partition` stays as it is, so that no level depends on another. Adds to the seconds in `time` by the laps
/// of `watch`. The scan's primitives from `own` on are those of neighbouring parts: they show how the surface
/// goes on, and tiles of these alone are left out.
RefinedLevel refine_level(const Primitives& primitives, const Partition& partition, const LevelRule& rule,
                          std::uint32_t own, Stopwatch& watch, BuildTimings& time);

}  // namespace rbvh
