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

/// Throws Error(kUsage) where an option is given that ambient occlusion has no use for.
void refuse_for_occlusion(const CLI::App& stage);

/// Throws Error(kUsage) where one of them is given and neither --light nor an AOV of light is; reads the file
/// that --light names, and says what of it cannot be kept.
void prepare_light(Context& context, LightOptions& options, bool has_aov);

}  // namespace rbvh
