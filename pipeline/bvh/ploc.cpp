#include "pipeline/bvh/ploc.h"

#include <algorithm>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/bvh/linked_bvh.h"
#include "pipeline/bvh/morton_order.h"
#include "pipeline/bvh/sah_binned_bvh.h"
#include "pipeline/device/prefix_sum.h"

namespace rbvh {
namespace {

/// A round adds a level at most. Scans take five or ten; after so many, neighbours are paired whatever their
/// boxes, which halves the clusters each round and so bounds the depth.
constexpr int kFreeRounds = 16;

std::uint32_t total(const Buffer<std::uint32_t>& sums, std::size_t count) {
  std::uint32_t value = 0;
  sums.read(std::span(&value, 1), count);
  return value;
}

struct Cluster {
  float lo[3];
  std::uint32_t link;
  float hi[3];
  std::uint32_t elements;
};

/// Adds the tree over the clusters to the nodes below them. Returns its root.
std::uint32_t join(const std::vector<Cluster>& clusters, std::vector<LinkedNode>& nodes) {
  std::vector<Bounds3f> boxes(clusters.size());
  for (std::size_t i = 0; i < clusters.size(); ++i) {
    const Cluster& c = clusters[i];
    boxes[i] = {{c.lo[0], c.lo[1], c.lo[2]}, {c.hi[0], c.hi[1], c.hi[2]}};
  }
  const Bvh top = build_sah_binned_bvh(boxes, {1, 1});
  const auto first = static_cast<std::uint32_t>(nodes.size());
  std::vector<std::uint32_t> links(top.nodes.size()), elements(top.nodes.size());
  std::uint32_t inner = 0;
  for (std::size_t i = 0; i < top.nodes.size(); ++i) {
    const BvhNode& node = top.nodes[i];
    links[i] = node.count > 0 ? clusters[top.order[node.first]].link : first + inner++;
  }
  nodes.resize(first + inner);
  for (std::size_t i = top.nodes.size(); i-- > 0;) {  // children are numbered after their parents
    const BvhNode& node = top.nodes[i];
    if (node.count > 0) {
      elements[i] = clusters[top.order[node.first]].elements;
      continue;
    }
    elements[i] = elements[node.first] + elements[node.first + 1];
    const Bounds3f& b = node.bounds;
    nodes[links[i]] = {{b.lo.x, b.lo.y, b.lo.z},
                       links[node.first],
                       {b.hi.x, b.hi.y, b.hi.z},
                       links[node.first + 1],
                       elements[i]};
  }
  return links[0];
}

}  // namespace

Bvh build_ploc(const Device& device, std::span<const Bounds3f> boxes, const BvhConfig& config,
               const PlocConfig& ploc) {
  RBVH_CHECK(ploc.radius > 0 && ploc.cluster_size > 0);
  MortonOrder order = morton_order(device, boxes, MortonBits::k63);
  if (order.count == 0) return {};
  const std::size_t group = element_group_size(device);
  const std::size_t most = order.count;
  Buffer<float> clusters(device, 8 * most);
  device.kernel("bvh/ploc", "ploc_leaves")
      .run(most, group, order.boxes, order.indices, order.count, clusters);
  std::uint32_t count = std::exchange(order, {}).count;
  Buffer<float> next(device, 8 * most);
  const Buffer<std::uint32_t> nearest(device, most), merged(device, most + 1), kept(device, most + 1);
  const Buffer<LinkedNode> nodes(device, most - 1);
  const Kernel find = device.kernel("bvh/ploc", "ploc_nearest"),
               pair = device.kernel("bvh/ploc", "ploc_pairs"),
               merge = device.kernel("bvh/ploc", "ploc_merge");
  std::uint32_t made = 0;
  for (int round = 0; count > std::max<std::size_t>(1, most / ploc.cluster_size); ++round) {
    const std::uint32_t forced = round >= kFreeRounds ? 1 : 0;
    find.run(count, group, clusters, count, ploc.radius, forced, nearest);
    pair.run(count, group, nearest, count, merged, kept);
    prefix_sum(device, merged, count, merged);
    prefix_sum(device, kept, count, kept);
    merge.run(count, group, clusters, nearest, count, merged, kept, made, nodes, next);
    made += total(merged, count);
    const std::uint32_t remaining = total(kept, count);
    RBVH_CHECK(remaining < count);
    count = remaining;
    std::swap(clusters, next);
  }
  static_assert(sizeof(Cluster) == 8 * sizeof(float));
  std::vector<Cluster> left(count);
  clusters.read(std::span(reinterpret_cast<float*>(left.data()), 8 * left.size()));
  std::vector<LinkedNode> linked(made);
  nodes.read(std::span(linked));
  const std::uint32_t root = join(left, linked);
  return order_linked_bvh(linked, root, boxes, config);
}

}  // namespace rbvh
