// The partition on the host: one core, one primitive after the other, sums in double. It serves
// PartitionWhere::kHost and is the oracle of the device's partition: the two share structs and no code. They
// may differ where, within the rounding of float, a primitive's centre lies on a plane or two candidates cost
// the same.
#pragma once

#include <functional>
#include <vector>

#include "pipeline/rbvh/partition.h"

namespace rbvh {

/// The primitives on the host, in the device's (Morton) order.
struct HostPrimitives {
  std::vector<Float4> box_lo;  ///< w: area
  std::vector<Float4> box_hi, area_normal;
  std::vector<std::uint32_t> objects;  ///< empty where all are of one object
};

/// As make_root(), split_nodes() and split_once(), which call these for a partition that has `host`.
Partition make_root_on_host(const Primitives& primitives, bool cones, SplitRule rule);
void split_nodes_on_host(Partition& partition, std::vector<std::uint32_t> active,
                         const std::function<bool(const PartitionNode&)>& wants_split,
                         const Progress& progress);
void split_once_on_host(Partition& partition, const std::vector<SplitRequest>& requests);

}  // namespace rbvh
