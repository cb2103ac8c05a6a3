#include "pipeline/rbvh/rbvh.h"

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

}  // namespace rbvh
