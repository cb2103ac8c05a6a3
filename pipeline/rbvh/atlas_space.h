// The atlas of a level whose tiles change: what removed tiles leave is taken again.
#pragma once

#include <cstdint>
#include <span>

#include "pipeline/rbvh/pack_atlas.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// Places tiles without a place (`has_place` 0) beside those that have one, in an atlas of `size`: where it
/// is free, else below it. All are placed anew (pack_tiles()) where more than a third of the atlas would be
/// empty. Returns its new size. Throws Error(kBudget) as pack_tiles() does.
AtlasSize place_tiles(std::span<LayerTile> tiles, std::span<const std::uint8_t> has_place, AtlasSize size);

}  // namespace rbvh
