// The tree over primitives (section 6 of the paper), built breadth-first on the device or, on request, on the
// host (partition_host.h). choose_split.h chooses the planes. Which nodes are leaves depends on the level:
// one tree serves all levels, each being a cut through it.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/rbvh/leaf_policy.h"
#include "pipeline/rbvh/primitives.h"
#include "rbvh/build.h"
#include "rbvh/progress.h"

namespace rbvh {

/// references[begin, end) are the node's primitives, in Morton order.
struct PartitionNode {
  PrimitiveSums sums{};
  std::uint32_t begin = 0, end = 0;
  float cone_cosine = 1;  ///< of the half-angle of the cone of normals; 1 unless Partition::cones
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

inline NodeFacts facts(const PartitionNode& node) {
  return {node.count(), node.objects.count, node.sums.area, node.projected_area(), node.cone_cosine};
}

struct HostPrimitives;

/// The tree so far. Node 0 is the root.
struct Partition {
  std::vector<PartitionNode> nodes;
  Buffer<std::uint32_t> references;  ///< indices into Primitives
  bool cones = false;
  SplitRule rule = SplitRule::kSpatialMedian;
  std::shared_ptr<const HostPrimitives> host = {};  ///< with these the host splits, else the device
};

/// With `cones`, this node and its descendants have their cone of normals: one more pass over the primitives.
Partition make_root(const Primitives& primitives, bool cones, SplitRule rule = SplitRule::kSpatialMedian,
                    PartitionWhere where = PartitionWhere::kDevice);

/// Splits the given nodes, one of exactly two objects by object and the others by the partition's rule, then
/// their children while `wants_split` holds. A node of one primitive is never split.
void split_nodes(Partition& partition, const Primitives& primitives, std::vector<std::uint32_t> active,
                 const std::function<bool(const PartitionNode&)>& wants_split, const Progress& progress = {});

/// A node to be split once.
struct SplitRequest {
  std::uint32_t node;
  SplitBy by = SplitBy::kRule;
  Vec3f direction{};  ///< kFacing, kHeight: unit
  float position =
      0;  ///< along it: kFacing: the least one of unit normals that face it; kHeight: the plane's
  std::uint32_t first = 0;  ///< kFirst: references in the left child
};

/// Splits each node once, also nodes that have children, which are then unreachable.
void split_once(Partition& partition, const Primitives& primitives,
                const std::vector<SplitRequest>& requests);

}  // namespace rbvh
