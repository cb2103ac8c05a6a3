// The tree over primitives (section 6 of the paper): breadth-first, on the device or, where that is asked
// for, on the host (partition_host.h); where a node is split, choose_split.h says. Where a node ends up as a
// leaf depends on the level; one tree serves all levels, each being a cut through it.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/base/progress.h"
#include "pipeline/rbvh/primitives.h"

namespace rbvh {

/// references[begin, end) are the node's primitives, in Morton order.
struct PartitionNode {
  PrimitiveSums sums{};
  std::uint32_t begin = 0, end = 0;
  float cone_cosine = 1;  ///< of the half-angle of the cone of normals, where cones are asked for
  ObjectSet objects{{0, 0}, 1};
  std::int32_t left = -1;  ///< index of the left child, the right one follows; -1: not split (yet)

  std::uint32_t count() const { return end - begin; }
  float projected_area() const {
    const float* n = sums.area_normal;
    return std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  }
  Bounds3f bounds() const {
    return {{sums.lo[0], sums.lo[1], sums.lo[2]}, {sums.hi[0], sums.hi[1], sums.hi[2]}};
  }
};

enum class SplitRule {
  kSpatialMedian,  ///< the middle of the longest axis
  kSurfaceArea,    ///< the least of equation 1, S(b) A(b) + S(c) A(c), among 32 planes along each axis
};

enum class PartitionWhere { kDevice, kHost };

struct HostPrimitives;

/// The tree so far. Node 0 is the root.
struct Partition {
  std::vector<PartitionNode> nodes;
  Buffer<std::uint32_t> references;  ///< indices into Primitives
  bool cones = false;
  SplitRule rule = SplitRule::kSpatialMedian;
  std::shared_ptr<const HostPrimitives> host = {};  ///< the host splits; none: the device does
};

/// Cuts [begin, end) into runs of at most `run_length` references.
void append_runs(std::vector<Run>& runs, std::uint32_t owner, std::uint32_t begin, std::uint32_t end,
                 std::uint32_t run_length);

/// With `cones`, this node and all that come of it know their cone of normals: one more pass over the
/// primitives.
Partition make_root(const Primitives& primitives, bool cones, SplitRule rule = SplitRule::kSpatialMedian,
                    PartitionWhere where = PartitionWhere::kDevice);

/// Splits the given nodes, what belongs to exactly two objects by these and all others by the partition's
/// rule, then their children as long as `wants_split` says so. A node of one primitive is never split.
void split_nodes(Partition& partition, const Primitives& primitives, std::vector<std::uint32_t> active,
                 const std::function<bool(const PartitionNode&)>& wants_split, const Progress& progress = {});

enum class SplitBy {
  kRule,      ///< as split_nodes()
  kFacing,    ///< what faces along `facing` from what does not
  kBoundary,  ///< what touches the surface's rim from what does not
  kFirst,     ///< the `first` first references from the rest
};

/// A node to be split once.
struct SplitRequest {
  std::uint32_t node;
  SplitBy by = SplitBy::kRule;
  Vec3f facing{};
  float cosine = 0;  ///< with `facing`, the least one of what faces along it
  std::uint32_t first = 0;
};

/// Splits each node once, also nodes that have children: those are forgotten.
void split_once(Partition& partition, const Primitives& primitives,
                const std::vector<SplitRequest>& requests);

}  // namespace rbvh
