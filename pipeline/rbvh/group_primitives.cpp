#include "pipeline/rbvh/group_primitives.h"

#include <algorithm>
#include <map>
#include <span>

#include "pipeline/base/parallel_for.h"
#include "pipeline/bvh/leaf_blocks.h"
#include "pipeline/bvh/sah_binned_bvh.h"
#include "pipeline/rbvh/leaf_primitives.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 14;

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
  RefinedLevel level;

 private:
  const Scan& scan_;
};

}  // namespace

RefinedLevel group_primitives(const Scan& scan, const Lattice& lattice) {
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
    if (primitives.size() <= kMostLeafPrimitives && groups.is_one_object(primitives)) {
      groups.add({primitives.begin(), primitives.end()});
    } else if (bvh.nodes[n].count == 0) {
      stack.push_back(bvh.nodes[n].first + 1);
      stack.push_back(bvh.nodes[n].first);
    } else {
      std::map<std::int32_t, std::vector<std::uint32_t>> by_object;
      for (const std::uint32_t i : primitives) by_object[groups.object(i)].push_back(i);
      for (const auto& [object, of_it] : by_object) groups.add(of_it);
    }
  }
  return std::move(groups.level);
}

}  // namespace rbvh
