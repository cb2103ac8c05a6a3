#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

const Level* Rbvh::find_level(const std::string& wanted) const {
  if (wanted.empty()) return levels.empty() ? nullptr : &levels.front();
  for (const Level& level : levels)
    if (level.name == wanted) return &level;
  return nullptr;
}

}  // namespace rbvh
