// What a pair's file keeps of what was measured, and how it is compared.
#pragma once

#include <string>

#include "pipeline/rbvh/rbvh.h"
#include "rbvh/measure.h"

namespace rbvh {

/// What a pair's file keeps of it. Wants images and distances to have been measured.
LevelFidelity stored_fidelity(const LevelMeasure& measure, const ViewsConfig& views);

/// Measures these levels with pictures and distances, and stores what is found in the pair. Throws as
/// measure_levels().
void measure_and_store(const Device& device, Asset& pair, const Asset& exact,
                       const std::vector<std::string>& levels, const ViewsConfig& views,
                       const MemoryBudget& memory = {}, const Progress& progress = {});

/// The same of all levels of a pair that was just built of this scan; both are as before.
void measure_and_store(const Device& device, Rbvh& rbvh, Scan& scan, const ViewsConfig& views,
                       const MemoryBudget& memory = {}, const Progress& progress = {});

/// A figure that is worse than the file says, in words ("3 holes, where the file says 0"), or nothing: beyond
/// what another device's rounding could explain. Both measured, with the same views.
std::string find_difference(const LevelFidelity& stored, const LevelFidelity& found);

}  // namespace rbvh
