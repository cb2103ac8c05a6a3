// Packs tiles into one map.
#pragma once

#include "pipeline/proxy/proxy.h"

namespace rbvh {

/// Sets map_width, map_height and the places of all tiles, whose sides are known; the map becomes zeros. The
/// largest tiles lie on top. Throws Error(kBudget) where the map would be over 65536 texels a side.
void pack_map(Proxy& proxy);

}  // namespace rbvh
