// --views and --resolution: how pairs are measured.
#pragma once

#include <string>

#include "cli/common.h"
#include "pipeline/measure/fidelity.h"

namespace rbvh {

/// Both go with the option named `with`.
void add_views_options(CLI::App& stage, ViewsConfig& views, const std::string& with);

}  // namespace rbvh
