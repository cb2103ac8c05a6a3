#include "pipeline/rbvh/rbvh.h"

#include <algorithm>
#include <limits>

#include "pipeline/rbvh/texel.h"

namespace rbvh {

const Level* Rbvh::find_level(const std::string& wanted) const {
  if (wanted.empty()) return levels.empty() ? nullptr : &levels.front();
  for (const Level& level : levels)
    if (level.name == wanted) return &level;
  return nullptr;
}

LayerKind layer_kind(std::string_view name) {
  if (name == "height") return LayerKind::kHeight;
  if (name == "normal") return LayerKind::kNormal;
  return name == "color" ? LayerKind::kColor : LayerKind::kUser;
}

const Layer* find_layer(const Level& level, std::string_view name) {
  for (const Layer& layer : level.layers)
    if (layer.name == name) return &layer;
  return nullptr;
}

double texel_side(const Level& level) {
  double sides = 0, texels = 0;
  for (const RbvhLeaf& leaf : level.leaves) {
    const TileFrame frame(leaf);
    const double count = static_cast<double>(leaf.width) * leaf.height;
    sides += count * (length(frame.u) + length(frame.v)) / 2;
    texels += count;
  }
  return texels > 0 ? sides / texels : 0;
}

double error_percent(const LevelFidelity& f) {
  if (!f.measured || f.more.views == 0) return std::numeric_limits<double>::quiet_NaN();
  return 100 * static_cast<double>(std::max(f.more.to_scan_rms, f.more.to_level_rms));
}

}  // namespace rbvh
