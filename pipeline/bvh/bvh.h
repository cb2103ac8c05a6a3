// The one binary bounding volume hierarchy that every builder makes and every flatten function takes. Knows
// boxes only: triangles, discs and tiles are all the same.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rbvh/geometry.h"

namespace rbvh {

/// Inner: count == 0, children at first and first + 1. Leaf: elements order[first] .. order[first + count -
/// 1].
struct BvhNode {
  Bounds3f bounds;
  std::uint32_t first = 0, count = 0;
};

struct Bvh {
  std::vector<BvhNode> nodes;        ///< node 0 is the root; none when there is no element
  std::vector<std::uint32_t> order;  ///< indices of the boxes, leaf after leaf
};

/// What a leaf may hold, and what a visit costs. The costs are those that "kd-tree and BVH on mobile GPUs"
/// (GRAPP 2019) found best: a high cost of nodes makes wide, shallow trees.
struct BvhConfig {
  /// No leaf has more elements.
  std::uint32_t leaf_size = 1;
  /// Elements that a tracer tests at once: n elements cost ceil(n / test_width) tests.
  std::uint32_t test_width = 1;
  float traversal_cost = 3.0f;
  float intersection_cost = 1.5f;

  float leaf_cost(std::size_t count) const {
    const std::size_t tests = (count + test_width - 1) / test_width;
    return intersection_cost * static_cast<float>(tests);
  }
};

/// No tree of any builder here is deeper, counted in nodes from the root to a leaf.
inline constexpr int kMaxBvhDepth = 120;

/// Nodes from the root to the deepest leaf; 0 for an empty tree.
int depth(const Bvh& bvh);

/// What a random ray that enters the root's box is expected to cost (the surface area heuristic).
double sah_cost(const Bvh& bvh, const BvhConfig& config);

/// Finite and not inverted; builders leave other boxes out.
bool is_usable(const Bounds3f& box);

/// The indices of the usable boxes.
std::vector<std::uint32_t> usable_boxes(std::span<const Bounds3f> boxes);

}  // namespace rbvh
