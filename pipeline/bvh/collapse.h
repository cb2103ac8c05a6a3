// Which binary nodes become the children of a wide node: the surface-area-optimal collapse of Ylitie, Karras,
// Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs" (HPG 2017), section 3.1.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/bvh/bvh.h"

namespace rbvh {

inline constexpr std::uint32_t kMaxWidth = 16;

/// For every inner node n and number of roots i in 2 .. width: how the subtree is best represented as a
/// forest of at most i wide trees. The leaves are the binary tree's own, so they cost the same in every
/// collapse, and the cost is the summed surface area of the wide nodes.
struct Collapse {
  std::uint32_t width = 0;
  /// choices[n * width + i - 1], i > 1: of i roots so many go to n's left child; 0: i - 1 roots are better.
  /// i = 1: n is a wide node, and its children are at most `width` roots: so many of them are the left
  /// child's.
  std::vector<std::uint8_t> choices;
  double cost = 0;  ///< summed surface area of all wide nodes
};

/// `width`: 2 to kMaxWidth. Children come after their parents in `bvh` (every builder sees to that).
Collapse collapse(const Bvh& bvh, std::uint32_t width);

/// The children of the wide node that an inner binary node becomes, from left to right.
struct WideChildren {
  std::uint32_t nodes[kMaxWidth];
  std::uint32_t count = 0;
};
WideChildren wide_children(const Bvh& bvh, const Collapse& collapse, std::uint32_t node);

}  // namespace rbvh
