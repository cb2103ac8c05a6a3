#include "pipeline/rbvh/group_primitives.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <utility>

#include "pipeline/base/parallel_for.h"
#include "pipeline/bvh/leaf_blocks.h"
#include "pipeline/bvh/sah_binned_bvh.h"
#include "pipeline/rbvh/leaf_primitives.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 14;
/// Of a triangle to its one-sided leaf's mean normal: a cosine.
constexpr float kLeastFacing = 0.35f;

/// Of each node its elements: order[begin] .. order[end - 1].
struct Range {
  std::uint32_t begin = 0, end = 0;
};

std::vector<Range> ranges_of(const Bvh& bvh) {
  std::vector<Range> ranges(bvh.nodes.size());
  for (std::size_t n = bvh.nodes.size(); n-- > 0;) {  // children come after their parents
    const BvhNode& node = bvh.nodes[n];
    ranges[n] = node.count > 0 ? Range{node.first, node.first + node.count}
                               : Range{ranges[node.first].begin, ranges[node.first + 1].end};
  }
  return ranges;
}

class Groups {
 public:
  explicit Groups(const Scan& scan) : scan_(scan) {}

  void add(std::vector<std::uint32_t> primitives) {
    Tile& tile = level.tiles.emplace_back();
    tile.decision = LeafDecision::kPrimitives;
    tile.leaf.primitives = static_cast<std::uint32_t>(primitives.size());
    tile.leaf.object_id = static_cast<std::uint32_t>(object(primitives.front()));
    level.held.push_back(std::move(primitives));
  }
  std::int32_t object(std::uint32_t primitive) const {
    return scan_.object_ids.empty() ? 0 : scan_.object_ids[primitive];
  }
  bool is_one_object(std::span<const std::uint32_t> primitives) const {
    return std::all_of(primitives.begin(), primitives.end(),
                       [&](std::uint32_t i) { return object(i) == object(primitives.front()); });
  }
  bool is_one_sided(std::span<const std::uint32_t> primitives) const {
    Vec3f mean{};
    for (const std::uint32_t i : primitives) mean = mean + area_normal(i);
    mean = normalized(mean);
    return std::all_of(primitives.begin(), primitives.end(), [&](std::uint32_t i) {
      const Vec3f n = area_normal(i);
      return dot(n, mean) >= kLeastFacing * length(n);
    });
  }
  /// The axis that the triangle faces along most, and which way.
  int side(std::uint32_t primitive) const {
    const Vec3f n = area_normal(primitive);
    int axis = 0;
    for (int i = 1; i < 3; ++i)
      if (std::abs(n[i]) > std::abs(n[axis])) axis = i;
    return 2 * axis + (n[axis] < 0);
  }
  RefinedLevel level;

 private:
  Vec3f area_normal(std::uint32_t primitive) const {
    const Triangle& t = scan_.triangles[primitive];
    const Vec3f a = scan_.positions[t[0]];
    return cross(scan_.positions[t[1]] - a, scan_.positions[t[2]] - a);
  }

  const Scan& scan_;
};

}  // namespace

RefinedLevel group_primitives(const Scan& scan, const Lattice& lattice, bool one_sided) {
  const std::size_t count = scan.is_cloud() ? scan.positions.size() : scan.triangles.size();
  const std::vector<Vec3f> places = snapped_positions(lattice, scan);
  std::vector<Bounds3f> boxes(count);
  parallel_for(count, kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      boxes[i] = placed_bounds(places, scan, static_cast<std::uint32_t>(i));
  });
  const Bvh bvh = build_sah_binned_bvh(boxes, kLeafBlockConfig);
  const std::vector<Range> ranges = ranges_of(bvh);
  Groups groups(scan);
  std::vector<std::uint32_t> stack = {0};
  while (!stack.empty()) {
    const std::uint32_t n = stack.back();
    stack.pop_back();
    const std::span<const std::uint32_t> primitives =
        std::span(bvh.order).subspan(ranges[n].begin, ranges[n].end - ranges[n].begin);
    if (primitives.size() <= kMostLeafPrimitives && groups.is_one_object(primitives) &&
        (!one_sided || groups.is_one_sided(primitives))) {
      groups.add({primitives.begin(), primitives.end()});
    } else if (bvh.nodes[n].count == 0) {
      stack.push_back(bvh.nodes[n].first + 1);
      stack.push_back(bvh.nodes[n].first);
    } else {
      std::map<std::pair<std::int32_t, int>, std::vector<std::uint32_t>> apart;
      for (const std::uint32_t i : primitives)
        apart[{groups.object(i), one_sided ? groups.side(i) : 0}].push_back(i);
      for (const auto& [of, them] : apart) groups.add(them);
    }
  }
  return std::move(groups.level);
}

}  // namespace rbvh
