#include "pipeline/bvh/flatten_wide16.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/bvh/sah_binned_bvh.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 14;
constexpr float kFar = 1e38f;

/// The children of a wide node: binary nodes, the one with the largest surface opened again and again.
struct Cut {
  std::uint32_t nodes[WIDE_NODE_WIDTH];
  std::uint32_t count = 0;
};

Cut widen(const Bvh& bvh, std::uint32_t root) {
  Cut cut;
  cut.nodes[cut.count++] = root;
  while (cut.count < WIDE_NODE_WIDTH) {
    float largest = -1.0f;
    std::uint32_t open = WIDE_NODE_WIDTH;
    for (std::uint32_t i = 0; i < cut.count; ++i) {
      const BvhNode& node = bvh.nodes[cut.nodes[i]];
      if (node.count == 0 && node.bounds.surface_area() > largest) {
        largest = node.bounds.surface_area();
        open = i;
      }
    }
    if (open == WIDE_NODE_WIDTH) break;  // leaves only
    const std::uint32_t first = bvh.nodes[cut.nodes[open]].first;
    cut.nodes[open] = first;
    cut.nodes[cut.count++] = first + 1;
  }
  return cut;
}

/// A wide node with the boxes of its children; they are still to be linked.
void put_boxes(const Bvh& bvh, const Cut& cut, WideNode& node) {
  std::fill_n(&node.planes[0][0], 6 * WIDE_NODE_WIDTH, kFar);
  std::fill_n(node.children, WIDE_NODE_WIDTH, BVH_LEAF_BIT);
  for (std::uint32_t slot = 0; slot < cut.count; ++slot) {
    const Bounds3f& b = bvh.nodes[cut.nodes[slot]].bounds;
    for (int axis = 0; axis < 3; ++axis) {
      node.planes[axis][slot] = b.lo[axis];
      node.planes[axis + 3][slot] = b.hi[axis];
    }
  }
}

PrimitiveBlock empty_block() {
  PrimitiveBlock block;
  std::fill_n(&block.rows[0][0], 9 * PRIMITIVE_BLOCK_WIDTH, std::numeric_limits<float>::quiet_NaN());
  std::fill_n(block.ids, PRIMITIVE_BLOCK_WIDTH, RBVH_NO_LEAF);
  return block;
}

void put_vector(PrimitiveBlock& block, std::size_t row, std::size_t lane, const Vec3f& v) {
  for (std::size_t axis = 0; axis < 3; ++axis) block.rows[row + axis][lane] = v[static_cast<int>(axis)];
}

void fill_block(const Bvh& bvh, const BvhNode& leaf, const Scan& scan, PrimitiveBlock& block) {
  RBVH_CHECK(leaf.count <= PRIMITIVE_BLOCK_WIDTH);
  for (std::uint32_t lane = 0; lane < leaf.count; ++lane) {
    const std::uint32_t id = bvh.order[leaf.first + lane];
    block.ids[lane] = id;
    if (scan.is_cloud()) {
      put_vector(block, 0, lane, scan.positions[id]);
      put_vector(block, 3, lane, static_cast<Vec3f>(normalized(static_cast<Vec3d>(scan.normals[id]))));
      block.rows[6][lane] = scan.radii[id];
    } else {
      for (std::size_t corner = 0; corner < 3; ++corner) {
        put_vector(block, 3 * corner, lane, scan.positions[scan.triangles[id][corner]]);
      }
    }
  }
}

}  // namespace

Wide16Nodes flatten_wide16_nodes(const Bvh& bvh) {
  Wide16Nodes layout;
  layout.scene.root = BVH_LEAF_BIT;
  layout.nodes.resize(1);
  std::vector<std::uint32_t>& leaves = layout.leaves;
  struct Open {
    std::uint32_t binary, stack;  ///< stack: entries in use when it is visited
  };
  std::vector<Open> open;  // breadth first: the wide nodes of one depth, from number `first` on
  const auto link_to = [&](std::uint32_t binary, std::uint32_t stack, std::size_t first) {
    if (bvh.nodes[binary].count > 0) {
      leaves.push_back(binary);
      return BVH_LEAF_BIT | static_cast<std::uint32_t>(leaves.size());
    }
    open.push_back({binary, stack});
    return static_cast<std::uint32_t>(first + open.size() - 1);
  };
  if (!bvh.nodes.empty()) {
    const Bounds3f& b = bvh.nodes[0].bounds;
    for (int axis = 0; axis < 3; ++axis) {
      layout.scene.lo[axis] = b.lo[axis];
      layout.scene.hi[axis] = b.hi[axis];
    }
    layout.scene.root = link_to(0, 0, 0);
  }
  for (std::size_t first = 0; !open.empty();) {
    const std::vector<Open> items = std::exchange(open, {});
    const std::size_t next = first + items.size();
    std::vector<Cut> cuts(items.size());
    layout.nodes.resize(next);
    parallel_for(items.size(), kGrain / WIDE_NODE_WIDTH, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        cuts[i] = widen(bvh, items[i].binary);
        put_boxes(bvh, cuts[i], layout.nodes[first + i]);
      }
    });
    for (std::size_t i = 0; i < items.size(); ++i) {
      const std::uint32_t stack = items[i].stack + cuts[i].count - 1;
      layout.stack = std::max(layout.stack, stack);
      for (std::uint32_t slot = 0; slot < cuts[i].count; ++slot)
        layout.nodes[first + i].children[slot] = link_to(cuts[i].nodes[slot], stack, next);
    }
    first = next;
  }
  return layout;
}

Wide16Nodes build_wide16_over(std::span<const Bounds3f> boxes) {
  const Bvh bvh = build_sah_binned_bvh(boxes, BvhConfig{});
  Wide16Nodes wide = flatten_wide16_nodes(bvh);
  const auto relinked = [&](std::uint32_t child) {
    const std::uint32_t leaf = child & ~BVH_LEAF_BIT;
    if (!(child & BVH_LEAF_BIT) || leaf == 0) return child;
    return BVH_LEAF_BIT | bvh.order[bvh.nodes[wide.leaves[leaf - 1]].first];
  };
  for (WideNode& node : wide.nodes)
    for (std::uint32_t& child : node.children) child = relinked(child);
  wide.scene.root = relinked(wide.scene.root);
  wide.leaves.clear();
  return wide;
}

Wide16Layout flatten_wide16(const Bvh& bvh, const Scan& scan) {
  Wide16Nodes wide = flatten_wide16_nodes(bvh);
  Wide16Layout layout;
  layout.scene = wide.scene;
  layout.nodes = std::move(wide.nodes);
  layout.stack = wide.stack;
  const std::vector<std::uint32_t>& leaves = wide.leaves;
  layout.blocks.assign(leaves.size() + 1, empty_block());
  parallel_for(leaves.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      fill_block(bvh, bvh.nodes[leaves[i]], scan, layout.blocks[i + 1]);
  });
  return layout;
}

}  // namespace rbvh
