#include "pipeline/rbvh/level_rule.h"

namespace rbvh {
namespace {

const Focus* focus_of(const LevelRule& rule) { return rule.config->focus ? &*rule.config->focus : nullptr; }

/// Of the level at the node's point nearest to the focus.
LevelConfig quality(const LevelRule& rule, const PartitionNode& node) {
  const Focus* focus = focus_of(rule);
  if (focus == nullptr) return rule.level;
  return quality_at(rule.level, focus, distances(node.bounds(), focus->center).nearest);
}

}  // namespace

float texels_per_area(const LevelRule& rule, const PartitionNode& node) {
  return quality(rule, node).rho / rule.area;
}

bool wants_split(const LevelRule& rule, const PartitionNode& node) {
  const LevelConfig here = quality(rule, node);
  LeafQuality wanted{here.rho, here.rho / rule.area, here.alpha, here.phi_degrees, here.rho};
  if (const Focus* focus = focus_of(rule))
    wanted.farthest_rho = quality_at(rule.level, focus, distances(node.bounds(), focus->center).farthest).rho;
  const float largest =
      rule.largest_tile > 0 ? rule.largest_tile : optimal_resolution(here.rho, rule.config->rays);
  return wants_split(facts(node), wanted, rule.config->refinement, largest);
}

}  // namespace rbvh
