// Where the partition's nodes are split (section 3.2 of the paper): spatial median, surface area heuristic,
// objects.
#pragma once

#include <vector>

#include "pipeline/rbvh/partition.h"

namespace rbvh {

/// The middle of the node's longest axis.
Split spatial_median(const PartitionNode& node);

/// How each of these nodes is to be split: what belongs to exactly two objects by these, all others by the
/// partition's rule.
std::vector<Split> choose_splits(const Partition& partition, const Primitives& primitives,
                                 const std::vector<std::uint32_t>& nodes);

/// Adds what other primitives belong to.
void add(ObjectSet& to, const ObjectSet& from);

}  // namespace rbvh
