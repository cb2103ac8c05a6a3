// Checks a file of any kind: reads it to its end, and says in short what it contains.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "io/load_asset.h"
#include "io/proxy_file.h"

namespace rbvh {

struct CheckedFile {
  /// "file", "valid" (true), "kind" ("rbvh", "proxy", "scene", "mesh" or "cloud") and counts of what is there
  /// of that kind.
  nlohmann::ordered_json summary;
  std::optional<Asset> asset;  ///< a pair, or a scene with all its files
  std::optional<Proxy> proxy;
  ProxyHeader proxy_header;
};

/// The file may be hostile. Throws as load_asset(), naming its first fault. Scans are read, not kept.
CheckedFile check_file(const std::string& path, const LoadConfig& config = {}, const Progress& progress = {});

}  // namespace rbvh
