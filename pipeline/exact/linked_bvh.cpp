#include "pipeline/exact/linked_bvh.h"

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

class Orderer {
 public:
  Orderer(std::span<const LinkedNode> nodes, std::span<const Bounds3f> boxes, const BvhConfig& config)
      : nodes_(nodes), boxes_(boxes), config_(config) {}

  Bvh order(std::uint32_t root) const {
    struct Open {
      std::uint32_t link, node;
    };
    Bvh bvh;
    bvh.nodes.reserve(2 * nodes_.size() / std::max(1u, config_.leaf_size / 2) + 1);
    bvh.nodes.resize(1);
    std::vector<Open> stack = {{root, 0}};
    while (!stack.empty()) {
      const Open item = stack.back();
      stack.pop_back();
      BvhNode& node = bvh.nodes[item.node];
      node.bounds = bounds(item.link);
      if (is_leaf(item.link)) {
        node.first = static_cast<std::uint32_t>(bvh.order.size());
        gather(item.link, bvh.order);
        node.count = static_cast<std::uint32_t>(bvh.order.size()) - node.first;
      } else {
        const auto children = static_cast<std::uint32_t>(bvh.nodes.size());
        node.first = children;
        bvh.nodes.resize(children + 2);
        stack.push_back({nodes_[item.link].right, children + 1});
        stack.push_back({nodes_[item.link].left, children});
      }
    }
    return bvh;
  }

 private:
  static bool is_element(std::uint32_t link) { return (link & LINKED_LEAF_BIT) != 0; }
  std::uint32_t count(std::uint32_t link) const { return is_element(link) ? 1 : nodes_[link].count; }

  Bounds3f bounds(std::uint32_t link) const {
    if (is_element(link)) return boxes_[link & ~LINKED_LEAF_BIT];
    const LinkedNode& n = nodes_[link];
    return {{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}};
  }

  float leaf_cost(std::uint32_t link) const {
    return config_.leaf_cost(count(link)) * bounds(link).surface_area();
  }

  /// The least that the subtree can cost; it has few elements, so recursion is shallow.
  float least_cost(std::uint32_t link) const {
    if (is_element(link)) return leaf_cost(link);
    return std::min(leaf_cost(link), inner_cost(link));
  }
  float inner_cost(std::uint32_t link) const {
    return config_.traversal_cost * bounds(link).surface_area() + least_cost(nodes_[link].left) +
           least_cost(nodes_[link].right);
  }

  bool is_leaf(std::uint32_t link) const {
    const std::uint32_t n = count(link);
    if (n > config_.leaf_size) return false;
    return n <= config_.test_width || leaf_cost(link) <= inner_cost(link);
  }

  void gather(std::uint32_t link, std::vector<std::uint32_t>& order) const {
    if (is_element(link)) {
      order.push_back(link & ~LINKED_LEAF_BIT);
    } else {
      gather(nodes_[link].left, order);
      gather(nodes_[link].right, order);
    }
  }

  std::span<const LinkedNode> nodes_;
  std::span<const Bounds3f> boxes_;
  const BvhConfig& config_;
};

}  // namespace

Bvh order_linked_bvh(std::span<const LinkedNode> nodes, std::uint32_t root, std::span<const Bounds3f> boxes,
                     const BvhConfig& config) {
  RBVH_CHECK(config.leaf_size > 0 && config.test_width > 0);
  return Orderer(nodes, boxes, config).order(root);
}

}  // namespace rbvh
