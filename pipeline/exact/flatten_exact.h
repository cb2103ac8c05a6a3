// The explicit step from the build structure to the trace structure: a binary hierarchy over primitives
// becomes 16-wide nodes and blocks of primitives (kernels/exact_layout.h).
#pragma once

#include <vector>

#include "kernels/exact_layout.h"
#include "pipeline/exact/bvh.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

struct ExactLayout {
  ExactScene scene{};
  std::vector<ExactNode> nodes;    ///< at least one
  std::vector<ExactBlock> blocks;  ///< block 0 is empty
  std::uint32_t stack = 1;         ///< entries that a traversal can need at most
};

/// `bvh` is over the scan's triangles or, in a cloud, discs, with leaves of at most EXACT_BLOCK_WIDTH.
ExactLayout flatten_exact(const Bvh& bvh, const Scan& scan);

/// The box of every primitive; empty for one that can never be hit.
std::vector<Bounds3f> primitive_bounds(const Scan& scan);

}  // namespace rbvh
