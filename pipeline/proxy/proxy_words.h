// How a proxy is made, as a user says it.
#pragma once

#include <cstdint>
#include <string_view>
#include <utility>

#include "pipeline/proxy/import_vdm.h"

namespace rbvh {

// All of these throw Error(kUsage) with a line that quotes `text`.

inline constexpr std::pair<std::string_view, VdmSpace> kVdmSpaces[] = {
    {"object", VdmSpace::kObject}, {"world", VdmSpace::kWorld}, {"tangent", VdmSpace::kTangent}};

/// Texels a side of a tile: 2^k + 1, 3 to 1025.
std::uint32_t parse_tile_side(std::string_view text);

/// A displacement that a proxy can hold.
double parse_displacement(std::string_view text);

/// Above 0 and up to 100 percent, as a fraction.
double parse_percent(std::string_view text);
/// And 0.
double parse_percent_or_none(std::string_view text);

}  // namespace rbvh
