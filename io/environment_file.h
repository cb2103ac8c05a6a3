// Environment maps: latitude-longitude pictures of light, as EXR or Radiance HDR.
#pragma once

#include <string>
#include <string_view>

#include "rbvh/image.h"
#include "rbvh/light.h"
#include "rbvh/memory_budget.h"

namespace rbvh {

/// R G B, linear, row 0 on top. Negative values and those that are not finite become 0 (EXR's writers leave
/// such); a map larger than 4096 pixels a side is averaged down. `note`, where given, gets a sentence about
/// both, or stays empty. Throws Error(kInput).
Image read_environment_map(const std::string& path, std::string* note = nullptr);

/// The same of a file's bytes; `path` is for messages.
Image decode_environment_map(std::string_view file, const std::string& path, std::string* note = nullptr);

/// Reads the map where the light that is wanted is a file, and returns its note. Throws Error(kInput),
/// Error(kBudget).
std::string read_light(LightWords& words, const MemoryBudget& memory);

}  // namespace rbvh
