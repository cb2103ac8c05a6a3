// What a user says about cleaning, read.
#pragma once

#include <string_view>

#include "pipeline/scan/ingest.h"

namespace rbvh {

/// "K,SIGMA". Throws Error(kUsage).
Outliers parse_outliers(std::string_view text);

}  // namespace rbvh
