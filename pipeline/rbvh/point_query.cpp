#include "pipeline/rbvh/point_query.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/texel.h"

namespace rbvh {
namespace {

/// Points on the device at once.
constexpr std::size_t kBatch = std::size_t{1} << 20;
/// A tile extends no further past its leaf's box: its primitives' dilation, and some room.
constexpr double kBorderTexels = 3;
/// A surface farther (texels) than the nearest one by this is another one.
constexpr float kSameSurfaceTexels = 0.5f;
/// A point is at most so far from its surface, or `most` where that is more.
constexpr float kMostTexels = 4;
/// So that the only tile that covers a point counts at its very end, too.
constexpr float kLeastWeight = 1e-4f;

/// A texel's side along u, scan units.
float texel_of(const RbvhLeaf& leaf) {
  const float* m = leaf.to_tile;
  return 1.0f / length(Vec3f{m[0], m[1], m[2]});
}

std::vector<RbvhNode> grown_nodes(const Level& level) {
  std::vector<RbvhNode> nodes = level.nodes;
  for (std::size_t i = nodes.size(); i-- > 0;) {  // children come after their parents
    RbvhNode& node = nodes[i];
    if (node.count != 0) {
      const TileFrame frame(level.leaves[node.first]);
      const auto border = static_cast<float>(kBorderTexels * std::max(length(frame.u), length(frame.v)));
      for (int axis = 0; axis < 3; ++axis) {
        node.lo[axis] -= border;
        node.hi[axis] += border;
      }
      continue;
    }
    const RbvhNode &left = nodes[node.first], &right = nodes[node.first + 1];
    for (int axis = 0; axis < 3; ++axis) {
      node.lo[axis] = std::min(left.lo[axis], right.lo[axis]);
      node.hi[axis] = std::max(left.hi[axis], right.hi[axis]);
    }
  }
  return nodes;
}

}  // namespace

PointIndex make_point_index(const Device& device, const Level& level) {
  std::vector<RbvhPrimitive> shapes(std::max<std::size_t>(1, primitive_count(level)));
  for (std::uint32_t i = 0; i < primitive_count(level); ++i) shapes[i] = primitive_shape(level.primitives, i);
  return {.device = device,
          .nodes = Buffer<RbvhNode>(device, grown_nodes(level)),
          .leaves = Buffer<RbvhLeaf>(device, level.leaves),
          .heights = Buffer<std::uint16_t>(device, level.layers.at(0).texels),
          .first_primitives = Buffer<std::uint32_t>(device, first_primitives(level)),
          .primitives = Buffer<RbvhPrimitive>(device, shapes),
          .atlas_width = level.atlas_width,
          .discs = holds_discs(level) ? 1u : 0u};
}

PointHits query_points(const PointIndex& index, std::span<const Vec3f> points, float radius) {
  PointHits result;
  result.firsts.reserve(points.size() + 1);
  const Kernel find = index.device.kernel("trace/point_query", "point_query_find");
  for (std::size_t begin = 0; begin < points.size(); begin += kBatch) {
    const std::size_t count = std::min(kBatch, points.size() - begin);
    const Buffer<float> device_points(
        index.device, std::span(reinterpret_cast<const float*>(points.data() + begin), 3 * count));
    const Buffer<std::uint32_t> counts(index.device, count);
    const auto run = [&](std::uint32_t write, const Buffer<std::uint32_t>& firsts,
                         const Buffer<PointHit>& hits) {
      find.run(count, 64, index.nodes, index.leaves, index.heights, index.atlas_width, index.first_primitives,
               index.primitives, index.discs, device_points, static_cast<std::uint32_t>(count), radius, write,
               counts, firsts, hits);
    };
    run(0, {}, {});
    std::vector<std::uint32_t> firsts;
    std::uint64_t total = 0;
    for (const std::uint32_t n : counts.read()) {
      firsts.push_back(static_cast<std::uint32_t>(total));
      total += n;
      result.firsts.push_back(result.hits.size() + total);
    }
    if (total > 0xffffffffu)
      throw Error(ErrorKind::kBudget, "",
                  "there are over 4 billion tiles within the points' radius; make it smaller");
    const std::size_t before = result.hits.size();
    result.hits.resize(before + total);
    if (total == 0) continue;
    const Buffer<PointHit> hits(index.device, total);
    run(1, Buffer<std::uint32_t>(index.device, firsts), hits);
    hits.read(std::span(result.hits).subspan(before));
  }
  return result;
}

std::vector<Covering> covering(const Level& level, std::span<const PointHit> hits, float most) {
  float nearest = std::numeric_limits<float>::infinity();
  for (const PointHit& hit : hits)
    if (hit.covers != 0 &&
        std::abs(hit.distance) <= std::max(most, kMostTexels * texel_of(level.leaves[hit.leaf])))
      nearest = std::min(nearest, std::abs(hit.distance));
  std::vector<Covering> result;
  for (const PointHit& hit : hits) {
    if (hit.covers == 0) continue;
    const RbvhLeaf& leaf = level.leaves[hit.leaf];
    const float room = kSameSurfaceTexels * texel_of(leaf), farther = std::abs(hit.distance) - nearest;
    if (!(farther < room)) continue;
    const float to_border = std::min({hit.u, hit.v, static_cast<float>(leaf.width - 1) - hit.u,
                                      static_cast<float>(leaf.height - 1) - hit.v, 1.0f});
    const float weight = std::max(kLeastWeight, to_border * (1 - farther / room));
    result.push_back({hit.leaf, hit.u, hit.v, hit.distance, weight});
  }
  return result;
}

}  // namespace rbvh
