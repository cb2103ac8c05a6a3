#include "pipeline/bvh/bvh.h"

#include <algorithm>

namespace rbvh {

int depth(const Bvh& bvh) {
  if (bvh.nodes.empty()) return 0;
  struct Visit {
    std::uint32_t node;
    int depth;
  };
  int deepest = 0;
  std::vector<Visit> stack = {{0, 1}};
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    deepest = std::max(deepest, visit.depth);
    const BvhNode& node = bvh.nodes[visit.node];
    if (node.count > 0) continue;
    stack.push_back({node.first, visit.depth + 1});
    stack.push_back({node.first + 1, visit.depth + 1});
  }
  return deepest;
}

double sah_cost(const Bvh& bvh, const BvhConfig& config) {
  if (bvh.nodes.empty()) return 0;
  const auto area = [](const BvhNode& node) { return static_cast<double>(node.bounds.surface_area()); };
  double cost = 0;
  for (const BvhNode& node : bvh.nodes) {
    cost += area(node) * (node.count == 0 ? config.traversal_cost : config.leaf_cost(node.count));
  }
  return area(bvh.nodes[0]) > 0 ? cost / area(bvh.nodes[0]) : 0;
}

bool is_usable(const Bounds3f& box) { return is_finite(box.lo) && is_finite(box.hi) && !box.empty(); }

std::vector<std::uint32_t> usable_boxes(std::span<const Bounds3f> boxes) {
  std::vector<std::uint32_t> indices;
  indices.reserve(boxes.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if (is_usable(boxes[i])) indices.push_back(static_cast<std::uint32_t>(i));
  }
  return indices;
}

}  // namespace rbvh
