// What a user says about cleaning, read.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "pipeline/scan/ingest.h"

namespace rbvh {

/// "K,SIGMA". Throws Error(kUsage).
Outliers parse_outliers(std::string_view text);

/// "2,6": classes of points, 0 to 255. Throws Error(kUsage).
std::vector<std::uint8_t> parse_classes(std::string_view text);

}  // namespace rbvh
