#include "pipeline/bvh/flatten_bvh.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 14;
constexpr float kFar = 1e38f;

std::vector<BvhTriangle> leaf_triangles(const Bvh& bvh, const Scan& scan) {
  if (bvh.nodes.empty()) return {no_triangle()};
  std::vector<BvhTriangle> triangles(bvh.order.size());
  parallel_for(triangles.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) triangles[i] = exact_triangle(scan, bvh.order[i]);
  });
  for (const BvhNode& node : bvh.nodes) {
    if (node.count > 0) triangles[node.first + node.count - 1].is_last = 1;
  }
  return triangles;
}

/// Along which the children lie farthest apart.
std::uint32_t parting_axis(const BvhNode& first, const BvhNode& second) {
  const Vec3f apart = second.bounds.center() - first.bounds.center();
  std::uint32_t axis = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::abs(apart[i]) > std::abs(apart[static_cast<int>(axis)])) axis = static_cast<std::uint32_t>(i);
  }
  return axis;
}

}  // namespace

BvhTriangle no_triangle() {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  return {{kNan, kNan, kNan}, RBVH_NO_LEAF, {kNan, kNan, kNan}, 1, {kNan, kNan, kNan}, 0};
}

BvhTriangle exact_triangle(const Scan& scan, std::uint32_t id) {
  const Triangle& t = scan.triangles[id];
  const Vec3f &a = scan.positions[t[0]], &b = scan.positions[t[1]], &c = scan.positions[t[2]];
  return {{a.x, a.y, a.z}, id, {b.x, b.y, b.z}, 0, {c.x, c.y, c.z}, 0};
}

BvhRoot exact_scene(const Bounds3f& bounds) {
  if (bounds.empty()) return {};
  return {{bounds.lo.x, bounds.lo.y, bounds.lo.z}, 0, {bounds.hi.x, bounds.hi.y, bounds.hi.z}, 0};
}

PairLayout flatten_bvh_pairs(const Bvh& bvh, const Scan& scan) {
  PairLayout layout;
  layout.triangles = leaf_triangles(bvh, scan);
  // The inner nodes' new numbers.
  std::vector<std::uint32_t> links(bvh.nodes.size());
  std::uint32_t inner = 0;
  for (std::size_t i = 0; i < bvh.nodes.size(); ++i) {
    links[i] = bvh.nodes[i].count > 0 ? BVH_LEAF_BIT | bvh.nodes[i].first : inner++;
  }
  layout.scene = exact_scene(bvh.nodes.empty() ? Bounds3f{} : bvh.nodes[0].bounds);
  layout.scene.root = bvh.nodes.empty() ? BVH_LEAF_BIT : links[0];
  layout.nodes.resize(std::max(1u, inner));
  parallel_for(bvh.nodes.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (bvh.nodes[i].count > 0) continue;
      NodePair& node = layout.nodes[links[i]];
      for (std::size_t k = 0; k < 2; ++k) {
        const std::size_t child = bvh.nodes[i].first + k;
        const Bounds3f& b = bvh.nodes[child].bounds;
        for (int axis = 0; axis < 3; ++axis) {
          node.planes[axis][k] = b.lo[axis];
          node.planes[axis + 3][k] = b.hi[axis];
        }
        node.children[k] = links[child];
      }
    }
  });
  return layout;
}

ParentLayout flatten_bvh_parents(const Bvh& bvh, const Scan& scan) {
  RBVH_CHECK(bvh.nodes.size() < PARENT_INDEX_MASK);
  ParentLayout layout;
  layout.triangles = leaf_triangles(bvh, scan);
  layout.scene = exact_scene(bvh.nodes.empty() ? Bounds3f{} : bvh.nodes[0].bounds);
  if (bvh.nodes.empty()) {  // far away, without extent: never hit
    layout.nodes.push_back({{kFar, kFar, kFar}, BVH_LEAF_BIT, {kFar, kFar, kFar}, 0});
    return layout;
  }
  // Node 1 stays unused: siblings, neighbours in the tree from 1 on, come to lie at even and odd places, the
  // lower one along their axis first.
  const auto count = static_cast<std::uint32_t>(bvh.nodes.size());
  std::vector<std::uint32_t> places(count), axes(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t child = bvh.nodes[i].first;
    if (bvh.nodes[i].count > 0) continue;
    axes[i] = parting_axis(bvh.nodes[child], bvh.nodes[child + 1]);
    const int axis = static_cast<int>(axes[i]);
    const bool turned = bvh.nodes[child + 1].bounds.center()[axis] < bvh.nodes[child].bounds.center()[axis];
    places[child] = child + (turned ? 2 : 1);
    places[child + 1] = child + (turned ? 1 : 2);
  }
  layout.nodes.resize(count + 1);
  for (std::uint32_t i = 0; i < count; ++i) {
    const BvhNode& from = bvh.nodes[i];
    ParentNode& to = layout.nodes[places[i]];
    for (int axis = 0; axis < 3; ++axis) {
      to.lo[axis] = from.bounds.lo[axis];
      to.hi[axis] = from.bounds.hi[axis];
    }
    if (from.count > 0) {
      to.down = BVH_LEAF_BIT | from.first;
      continue;
    }
    const std::uint32_t axis = axes[i] << PARENT_AXIS_SHIFT;
    to.down = axis | std::min(places[from.first], places[from.first + 1]);
    for (std::uint32_t k = 0; k < 2; ++k) layout.nodes[places[from.first + k]].up = axis | places[i];
  }
  return layout;
}

}  // namespace rbvh
