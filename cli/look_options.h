// What pictures look like, and from where: f3d's words where it has one.
#pragma once

#include "cli/common.h"
#include "pipeline/render/look.h"

namespace rbvh {

void add_look_options(CLI::App& stage, Look& look);

}  // namespace rbvh
