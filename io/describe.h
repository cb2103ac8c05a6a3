// What a pair, a proxy, a scene or a scan holds, as `info --json` prints it.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "io/load_asset.h"

namespace rbvh {

/// "file", "kind" ("rbvh", "proxy", "scene", "mesh" or "cloud") and what is there of that kind: counts,
/// bounds, bytes, hashes. The file may be hostile. Throws as load_asset().
nlohmann::ordered_json describe(const std::string& path, const LoadConfig& config = {});

}  // namespace rbvh
