// What an Asset holds: one of the three kinds.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "pipeline/rbvh/rbvh.h"
#include "pipeline/scene/scene.h"
#include "rbvh/asset.h"
#include "rbvh/mesh.h"
#include "rbvh/scan.h"

namespace rbvh {

struct AssetContent {
  std::variant<Rbvh, Scan, Scene> value;
};

/// Without path and name.
Asset make_asset(Rbvh&& rbvh);
Asset make_asset(Scene&& scene);

/// level_mesh() (rbvh/mesh.h) without a texture.
Scan plain_level_mesh(const Asset& pair, const std::string& level, LevelMeshCounts* counts = nullptr);

/// ScanAttributes::texture_faults of its scans.
std::vector<std::string> texture_faults(const Asset& asset);

}  // namespace rbvh
