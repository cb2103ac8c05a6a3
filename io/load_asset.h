// Reads a file of any kind that rays can be cast at, told by its content.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "io/rbvh_file.h"
#include "pipeline/base/memory_budget.h"
#include "pipeline/base/progress.h"
#include "pipeline/scene/asset.h"

namespace rbvh {

struct LoadConfig {
  MemoryBudget memory;
  /// Proxies become triangles, up to 2^tessellate micro-quads a side of a patch.
  std::optional<std::uint32_t> tessellate;
};

/// True for a file that starts as an .rbvh does, or is named as one.
bool is_rbvh(const std::string& path);

/// Reads a pair, its texels once it is known that there is memory for them.
Rbvh load_pair(const std::string& path, const MemoryBudget& memory = {}, PairHeader* header = nullptr);

/// Reads a scan of any ingest format, uncleaned. A cloud gets the normals and radii that it lacks. Throws
/// Error(kInput), also where nothing finite is left or all points are equal.
Scan load_scan(const std::string& path, const MemoryBudget& memory = {}, const Progress& progress = {});

/// Reads a pair, a scan ("-": from standard input), a proxy or a scene and all its objects. The file may be
/// hostile. Throws Error(kInput), and Error(kBudget) before more memory is taken than allowed.
Asset load_asset(const std::string& path, const LoadConfig& config = {}, const Progress& progress = {});

/// The scan that `pair` is to be measured against, in the pair's coordinates.
Asset load_reference(const std::string& path, const Rbvh& pair, const MemoryBudget& memory = {},
                     const Progress& progress = {});

}  // namespace rbvh
