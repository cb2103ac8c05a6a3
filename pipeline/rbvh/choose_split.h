// The planes that split the partition's nodes (section 3.2 of the paper): spatial median or surface area
// heuristic.
#pragma once

#include <vector>

#include "pipeline/rbvh/partition.h"

namespace rbvh {

/// The middle of the node's longest axis.
Split spatial_median(const PartitionNode& node);

/// A split for each of these nodes: one of exactly two objects is split by object, any other by the
/// partition's rule.
std::vector<Split> choose_splits(const Partition& partition, const Primitives& primitives,
                                 const std::vector<std::uint32_t>& nodes);

/// The objects of both.
void add(ObjectSet& to, const ObjectSet& from);

}  // namespace rbvh
