#include "pipeline/bvh/lbvh.h"

#include "pipeline/base/stopwatch.h"
#include "pipeline/bvh/linked_bvh.h"

namespace rbvh {
namespace {

template <class Key>
std::vector<LinkedNode> make_nodes(const Device& device, const MortonOrder& order, const Buffer<Key>& codes) {
  const std::string options = sizeof(Key) == 8 ? "-DKEY=ulong" : "-DKEY=uint";
  const std::size_t group = element_group_size(device);
  const std::uint32_t count = order.count;
  const Buffer<float> pyramid(device, 2 * std::size_t{count} * 8);
  device.kernel("bvh/lbvh", "lbvh_leaves", options)
      .run(count, group, order.boxes, order.indices, count, pyramid);
  const Kernel join = device.kernel("bvh/lbvh", "lbvh_pyramid", options);
  for (std::uint32_t from = 0, size = count; size > 1; from += size, size /= 2) {
    join.run(size / 2, group, pyramid, from, from + size, size / 2);
  }
  const Buffer<LinkedNode> nodes(device, count - 1);
  device.kernel("bvh/lbvh", "lbvh_nodes", options)
      .run(count - 1, group, codes, order.indices, count, pyramid, nodes);
  return nodes.read();
}

}  // namespace

Bvh build_lbvh(const Device& device, std::span<const Bounds3f> boxes, const BvhConfig& config,
               MortonBits bits, LbvhTimings* timings) {
  Stopwatch watch;
  LbvhTimings times;
  MortonOrder order = morton_order(device, boxes, bits);
  times.order = watch.lap();
  times.sort = order.sort_seconds;
  Bvh bvh;
  if (order.count == 1) {
    std::uint32_t only = 0;
    order.indices.read(std::span(&only, 1));
    bvh = order_linked_bvh({}, LINKED_LEAF_BIT | only, boxes, config);
  } else if (order.count > 1) {
    const std::vector<LinkedNode> nodes = bits == MortonBits::k63 ? make_nodes(device, order, order.codes63)
                                                                  : make_nodes(device, order, order.codes30);
    order = {};
    times.nodes = watch.lap();
    bvh = order_linked_bvh(nodes, 0, boxes, config);
    times.link = watch.lap();
  }
  if (timings != nullptr) *timings = times;
  return bvh;
}

}  // namespace rbvh
