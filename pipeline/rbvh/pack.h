// From a level's tiles to what is stored: atlas, hierarchy, exact primitives.
#pragma once

#include "pipeline/rbvh/level_config.h"
#include "pipeline/rbvh/primitives.h"
#include "pipeline/rbvh/rbvh.h"
#include "pipeline/rbvh/refine.h"

namespace rbvh {

Level pack_level(const LevelConfig& config, RefinedLevel& refined, const Primitives& primitives);

}  // namespace rbvh
