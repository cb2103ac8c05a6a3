// Environment maps: latitude-longitude pictures of light, as EXR or Radiance HDR.
#pragma once

#include <string>
#include <string_view>

#include "rbvh/image.h"
#include "rbvh/light.h"
#include "rbvh/memory_budget.h"

namespace rbvh {

/// R G B, linear, row 0 on top. Negative values and those that are not finite become 0 (EXR's writers leave
/// such); a map larger than 4096 pixels a side is averaged down. Throws Error(kInput).
Image read_environment_map(const std::string& path);

/// The same of a file's bytes; `path` is for messages.
Image decode_environment_map(std::string_view file, const std::string& path);

/// Reads the map where the light that is wanted is a file. Throws Error(kInput), Error(kBudget).
void read_light(LightWords& words, const MemoryBudget& memory);

}  // namespace rbvh
