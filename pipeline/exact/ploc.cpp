#include "pipeline/exact/ploc.h"

#include <bit>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/device/prefix_sum.h"
#include "pipeline/exact/linked_bvh.h"
#include "pipeline/exact/morton_order.h"

namespace rbvh {
namespace {

/// A round adds a level at most. Scans take some forty; after so many, neighbours are paired whatever their
/// boxes, which halves the clusters each round and so bounds the depth.
constexpr int kFreeRounds = 60;

std::uint32_t total(const Buffer<std::uint32_t>& sums, std::size_t count) {
  std::uint32_t value = 0;
  sums.read(std::span(&value, 1), count);
  return value;
}

}  // namespace

Bvh build_ploc(const Device& device, std::span<const Bounds3f> boxes, const BvhConfig& config,
               const PlocConfig& ploc) {
  RBVH_CHECK(ploc.radius > 0);
  MortonOrder order = morton_order(device, boxes, MortonBits::k63);
  if (order.count == 0) return {};
  const std::size_t group = element_group_size(device);
  const std::size_t most = order.count;
  Buffer<float> clusters(device, 8 * most);
  device.kernel("ploc", "ploc_leaves").run(most, group, order.boxes, order.indices, order.count, clusters);
  std::uint32_t count = std::exchange(order, {}).count;
  Buffer<float> next(device, 8 * most);
  const Buffer<std::uint32_t> nearest(device, most), merged(device, most + 1), kept(device, most + 1);
  const Buffer<LinkedNode> nodes(device, most - 1);
  const Kernel find = device.kernel("ploc", "ploc_nearest"), pair = device.kernel("ploc", "ploc_pairs"),
               merge = device.kernel("ploc", "ploc_merge");
  std::uint32_t made = 0;
  for (int round = 0; count > 1; ++round) {
    const std::uint32_t forced = round >= kFreeRounds ? 1 : 0;
    find.run(count, group, clusters, count, ploc.radius, forced, nearest);
    pair.run(count, group, nearest, count, merged, kept);
    prefix_sum(device, merged, count, merged);
    prefix_sum(device, kept, count, kept);
    merge.run(count, group, clusters, nearest, count, merged, kept, made, nodes, next);
    made += total(merged, count);
    const std::uint32_t left = total(kept, count);
    RBVH_CHECK(left < count);
    count = left;
    std::swap(clusters, next);
  }
  std::vector<float> root(8);
  clusters.read(std::span(root));
  return order_linked_bvh(nodes.read(), std::bit_cast<std::uint32_t>(root[3]), boxes, config);
}

}  // namespace rbvh
