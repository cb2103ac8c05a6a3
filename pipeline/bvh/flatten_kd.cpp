#include "pipeline/bvh/flatten_kd.h"

#include <bit>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/bvh/flatten_bvh.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 14;

template <class Node>
KdLayout<Node> begin_layout(const KdTree& tree, const Scan& scan) {
  KdLayout<Node> layout;
  layout.scene = exact_scene(tree.bounds);
  if (tree.nodes.empty()) {
    layout.nodes.resize(1);
    layout.nodes[0].link = kKdLeaf;  // no references
    layout.triangles = {no_triangle()};
    layout.references = {0};
    return layout;
  }
  RBVH_CHECK(tree.nodes.size() < (1u << 30) && tree.references.size() < (1u << 30));
  layout.nodes.resize(tree.nodes.size());
  layout.references = tree.references;
  layout.triangles.resize(scan.triangles.size());
  parallel_for(layout.triangles.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      layout.triangles[i] = exact_triangle(scan, static_cast<std::uint32_t>(i));
    }
  });
  return layout;
}

float position(const KdNode& node) {
  return node.axis == kKdLeaf ? std::bit_cast<float>(node.count) : node.position;
}

}  // namespace

KdLayout<KdCutNode> flatten_kd_cuts(const KdTree& tree, const Scan& scan) {
  static_assert(KD_LEAF == kKdLeaf);
  KdLayout<KdCutNode> layout = begin_layout<KdCutNode>(tree, scan);
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    const KdNode& node = tree.nodes[i];
    layout.nodes[i] = {position(node), node.first << 2 | node.axis};
  }
  return layout;
}

KdLayout<KdCellNode> flatten_kd_cells(const KdTree& tree, const Scan& scan) {
  KdLayout<KdCellNode> layout = begin_layout<KdCellNode>(tree, scan);
  const std::vector<Bounds3f> boxes = cells(tree);
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    const KdNode& from = tree.nodes[i];
    KdCellNode& to = layout.nodes[i];
    for (int axis = 0; axis < 3; ++axis) {
      to.lo[axis] = boxes[i].lo[axis];
      to.hi[axis] = boxes[i].hi[axis];
    }
    to.link = from.first << 2 | from.axis;
    to.position = position(from);
    if (from.axis == kKdLeaf) continue;
    for (std::uint32_t k = 0; k < 2; ++k) layout.nodes[from.first + k].parent = static_cast<std::uint32_t>(i);
  }
  return layout;
}

}  // namespace rbvh
