#include "pipeline/rbvh/overlaps.h"

#include <algorithm>

#include "pipeline/base/error.h"

namespace rbvh {

Overlaps find_overlaps(const Partition& partition, const Primitives& primitives,
                       const std::vector<OverlapQuery>& queries) {
  const Device& device = primitives.device;
  std::vector<PartitionBox> boxes(partition.nodes.size());
  for (std::size_t n = 0; n < boxes.size(); ++n) {
    const PartitionNode& node = partition.nodes[n];
    std::copy_n(node.sums.lo, 3, boxes[n].lo);
    std::copy_n(node.sums.hi, 3, boxes[n].hi);
    boxes[n].left = node.left;
    boxes[n].begin = node.begin;
    boxes[n].end = node.end;
  }
  const Buffer<PartitionBox> device_boxes(device, boxes);
  const Buffer<OverlapQuery> device_queries(device, queries);
  const auto count = static_cast<std::uint32_t>(queries.size());
  const Buffer<std::uint32_t> counts(device, queries.size()), none(device, 1);
  const Kernel find = device.kernel("build/overlaps", "overlaps_find");
  find.run(count, job_group_size(device), device_boxes, device_queries, count, partition.references,
           primitives.box_lo, primitives.box_hi, 0u, counts, none, none);

  Overlaps overlaps;
  std::uint64_t total = 0;
  for (const std::uint32_t n : counts.read()) {
    overlaps.firsts.push_back(static_cast<std::uint32_t>(total));
    total += n;
  }
  if (total > 0xffffffffu)
    throw Error(ErrorKind::kBudget, "",
                "neighbouring tiles share more than 4 billion primitives; a coarser level is wanted");
  overlaps.firsts.push_back(static_cast<std::uint32_t>(total));
  overlaps.primitives = Buffer<std::uint32_t>(device, std::max<std::uint64_t>(total, 1));
  find.run(count, job_group_size(device), device_boxes, device_queries, count, partition.references,
           primitives.box_lo, primitives.box_hi, 1u, counts, Buffer<std::uint32_t>(device, overlaps.firsts),
           overlaps.primitives);
  device.finish();
  return overlaps;
}

}  // namespace rbvh
