// From the nodes that a device builder leaves behind to the common tree: leaves are gathered where that pays,
// and everything is put in depth-first order.
#pragma once

#include <span>

#include "kernels/bvh/linked_layout.h"
#include "pipeline/bvh/bvh.h"

namespace rbvh {

/// `root` is a node or, with LINKED_LEAF_BIT, the only element.
Bvh order_linked_bvh(std::span<const LinkedNode> nodes, std::uint32_t root, std::span<const Bounds3f> boxes,
                     const BvhConfig& config);

}  // namespace rbvh
