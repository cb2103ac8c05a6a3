// Options of pictures by paths of light.
#pragma once

#include <string>
#include <vector>

#include "cli/common.h"
#include "rbvh/light.h"

namespace rbvh {

struct LightOptions {
  LightWords words{.light = {}};  ///< of light, empty: pictures are not lit by paths
  PathConfig paths;
  bool ground = false, linear = false;
  std::string cached;                        ///< a layer that lights the picture in place of paths
  std::string bounce_level;                  ///< of secondary rays; empty: the same
  double distance = 0;                       ///< that --aov ao sees; 0: all
  std::vector<const CLI::Option*> declared;  ///< all but --light
};

void add_light_options(CLI::App& stage, LightOptions& options);

/// Those that have a use without a camera.
void add_baked_light_options(CLI::App& stage, LightOptions& options);

/// Throws Error(kUsage) where one of them is given and neither --light nor an AOV of light is; reads the file
/// that --light names, within `memory`.
void prepare_light(LightOptions& options, bool has_aov, const MemoryBudget& memory);

}  // namespace rbvh
