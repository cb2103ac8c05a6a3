// Options of pictures by paths of light.
#pragma once

#include <string>
#include <vector>

#include "cli/common.h"
#include "pipeline/light/picture.h"

namespace rbvh {

struct LightOptions : Lighting {
  std::string bounce_level;                  ///< of secondary rays; empty: the same
  std::vector<const CLI::Option*> declared;  ///< all but --light
};

void add_light_options(CLI::App& stage, LightOptions& options);

/// Those that have a use without a camera.
void add_baked_light_options(CLI::App& stage, LightOptions& options);

/// Throws Error(kUsage) where one of them is given and neither --light nor an AOV of light is; reads the file
/// that --light names, within `memory`.
void prepare_light(LightOptions& options, bool has_aov, const MemoryBudget& memory);

}  // namespace rbvh
