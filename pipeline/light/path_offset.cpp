#include <algorithm>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/rbvh.h"
#include "pipeline/scene/asset_content.h"
#include "rbvh/light.h"

namespace rbvh {
namespace {

constexpr float kErrors = 3;  // a level's error is a root mean square

float mean_radius(const Scan& cloud) {
  double sum = 0;
  for (const float radius : cloud.radii) sum += static_cast<double>(radius);
  return cloud.radii.empty() ? 0 : static_cast<float>(sum / static_cast<double>(cloud.radii.size()));
}

// How far a level lies from the scan, scan units.
float error_of(const Level& level, float diagonal) {
  const float known = std::max(level.error, level.reached) * diagonal;
  return known > 0 ? kErrors * known : static_cast<float>(texel_side(level));
}

}  // namespace

float path_offset(const Asset& asset, const std::string& primary_level, const std::string& secondary_level) {
  if (const Scan* scan = asset.scan()) return scan->is_cloud() ? mean_radius(*scan) : 0;
  const Rbvh* rbvh = asset.rbvh();
  if (rbvh == nullptr) return 0;
  const float diagonal = rbvh->source.bounds.diagonal();
  float offset = 0;
  for (const std::string& name : {primary_level, secondary_level}) {
    const Level* level = rbvh->find_level(name);
    if (level == nullptr) level = &rbvh->levels.back();  // "auto": any of them
    if (asset.is_cloud)
      offset = std::max({offset, static_cast<float>(texel_side(*level)), mean_radius(level->primitives)});
    else if (primary_level != secondary_level || name == "auto")
      offset += error_of(*level, diagonal);
  }
  return offset;
}

}  // namespace rbvh
