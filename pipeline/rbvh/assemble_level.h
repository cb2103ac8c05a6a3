// From a level's leaves to what is stored: atlas, hierarchy, primitives.
#pragma once

#include "pipeline/rbvh/rbvh.h"
#include "pipeline/rbvh/refine.h"
#include "rbvh/build.h"

namespace rbvh {

/// `scan`: whose primitives the leaves hold. `area`: that rho is for, scan units squared. `lattice`: that the
/// primitives' positions are moved to; of step 0: they stay. `grid`: of frames and boxes, likewise.
Level assemble_level(const LevelConfig& config, RefinedLevel& refined, const Scan& scan, float area,
                     const Lattice& lattice, const LeafGrid& grid);

}  // namespace rbvh
