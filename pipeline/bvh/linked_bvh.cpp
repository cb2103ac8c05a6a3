#include "pipeline/bvh/linked_bvh.h"

#include "pipeline/base/error.h"
#include "pipeline/bvh/grow_bvh.h"

namespace rbvh {
namespace {

class Orderer {
 public:
  Orderer(std::span<const LinkedNode> nodes, std::span<const Bounds3f> boxes, const BvhConfig& config)
      : nodes_(nodes), boxes_(boxes), config_(config) {}

  Bvh order(std::uint32_t root) const {
    Bvh bvh;
    bvh.order.resize(count(root));
    bvh.nodes =
        grow_bvh(Range{root, 0, count(root), bounds(root)}, [&](const Range& range, bool) -> HalvesOf<Range> {
          if (is_leaf(range.link)) {
            gather(range.link, bvh.order.data() + range.begin);
            return {};
          }
          const std::uint32_t left = nodes_[range.link].left, right = nodes_[range.link].right;
          const std::size_t middle = range.begin + count(left);
          return {{Range{left, range.begin, middle, bounds(left)},
                   Range{right, middle, range.end, bounds(right)}}};
        });
    return bvh;
  }

 private:
  /// A subtree, and the places in the order that its elements take.
  struct Range {
    std::uint32_t link;
    std::size_t begin, end;
    Bounds3f box;
    std::size_t size() const { return end - begin; }
    const Bounds3f& node_bounds() const { return box; }
  };

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

  /// Returns the end of what it wrote.
  std::uint32_t* gather(std::uint32_t link, std::uint32_t* to) const {
    if (is_element(link)) {
      *to = link & ~LINKED_LEAF_BIT;
      return to + 1;
    }
    return gather(nodes_[link].right, gather(nodes_[link].left, to));
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
