// From a binary hierarchy to what wide16 walks: 16-wide nodes and blocks of primitives
// (kernels/trace/trace_wide16.cl).
#pragma once

#include <span>
#include <vector>

#include "kernels/bvh/bvh_layout.h"
#include "pipeline/bvh/bvh.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

/// The nodes alone: a child that is a leaf is BVH_LEAF_BIT | i for the binary node leaves[i - 1], and i = 0
/// for an unused slot, whose box is far away.
struct Wide16Nodes {
  BvhRoot scene{};
  std::vector<WideNode> nodes;  ///< at least one
  std::vector<std::uint32_t> leaves;
  std::uint32_t stack = 1;  ///< entries that a traversal can need at most
};
Wide16Nodes flatten_wide16_nodes(const Bvh& bvh);

/// A hierarchy over boxes: a child that is a leaf is BVH_LEAF_BIT | the box's number.
Wide16Nodes build_wide16_over(std::span<const Bounds3f> boxes);

struct Wide16Layout {
  BvhRoot scene{};
  std::vector<WideNode> nodes;         ///< at least one
  std::vector<PrimitiveBlock> blocks;  ///< block 0 is empty
  std::uint32_t stack = 1;             ///< entries that a traversal can need at most
};

/// `bvh` is over the scan's triangles or, in a cloud, discs, with leaves of at most PRIMITIVE_BLOCK_WIDTH.
Wide16Layout flatten_wide16(const Bvh& bvh, const Scan& scan);

}  // namespace rbvh
