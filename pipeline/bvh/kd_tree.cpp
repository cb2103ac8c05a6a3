#include "pipeline/bvh/kd_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/bvh/bvh.h"

namespace rbvh {
namespace {

constexpr std::size_t kSubtree = 1 << 15;  // elements below which a subtree is one thread's

/// Where a box begins or ends along an axis.
struct Event {
  float position;
  std::uint32_t id;  // of the box
};

/// By position, then by box, so that nothing depends on the sort.
bool operator<(const Event& a, const Event& b) {
  return a.position != b.position ? a.position < b.position : a.id < b.id;
}

/// The elements of a cell: both ends of each, along each axis, in order.
struct Events {
  std::array<std::vector<Event>, 3> begins, ends;
  std::size_t size() const { return begins[0].size(); }
};

struct Cell {
  Bounds3f bounds;
  Events events;
  int depth = 1, bad_cuts = 0;
};

struct Cut {
  double cost = std::numeric_limits<double>::infinity();
  float position = 0;
  std::uint32_t axis = 0;
  bool planar_below = false;  // where boxes that lie in the plane go
};

double half_area(const Bounds3f& b) {
  const auto e = static_cast<Vec3d>(b.extent());
  return e.x * e.y + e.y * e.z + e.z * e.x;
}

std::pair<Bounds3f, Bounds3f> halves(const Bounds3f& cell, std::uint32_t axis, float position) {
  std::pair<Bounds3f, Bounds3f> both{cell, cell};
  both.first.hi[static_cast<int>(axis)] = both.second.lo[static_cast<int>(axis)] = position;
  return both;
}

/// Nodes and references of a subtree, numbered from its own root.
struct Part {
  std::vector<KdNode> nodes;
  std::vector<std::uint32_t> references;
};

class Builder {
 public:
  Builder(std::span<const Bounds3f> boxes, const KdConfig& config, std::size_t count)
      : boxes_(boxes),
        config_(config),
        max_depth_(
            std::min(kMaxKdDepth, static_cast<int>(8 + 1.3 * std::log2(1.0 + static_cast<double>(count))))) {}

  /// Writes the subtree of `cell` to `part`, its root at nodes[root]. Small cells are put off where `later`
  /// is given.
  struct Later {
    Cell cell;
    std::size_t node;
  };
  void grow(Cell&& whole, std::size_t root, Part& part, std::vector<Later>* later) const {
    std::vector<Later> stack;
    stack.push_back({std::move(whole), root});
    while (!stack.empty()) {
      Later item = std::move(stack.back());
      stack.pop_back();
      Cell& cell = item.cell;
      if (later != nullptr && cell.events.size() <= kSubtree) {
        later->push_back(std::move(item));
        continue;
      }
      const Cut cut = best_cut(cell);
      const double leaf_cost = config_.intersection_cost * static_cast<double>(cell.events.size());
      // A cut may be bad and what comes after it good: two are allowed, where there is enough to gain.
      if (cut.cost >= leaf_cost) ++cell.bad_cuts;
      if (!std::isfinite(cut.cost) || cell.depth >= max_depth_ || cell.bad_cuts > 2 ||
          (cut.cost >= leaf_cost && cell.events.size() <= 4)) {
        put_leaf(cell, part.nodes[item.node], part);
        continue;
      }
      const std::size_t children = part.nodes.size();
      part.nodes[item.node] = {cut.position, cut.axis, static_cast<std::uint32_t>(children), 0};
      part.nodes.resize(children + 2);
      auto [below, above] = divide(std::move(cell), cut);
      stack.push_back({std::move(above), children + 1});
      stack.push_back({std::move(below), children});
    }
  }

 private:
  static void put_leaf(const Cell& cell, KdNode& node, Part& part) {
    node = {0, kKdLeaf, static_cast<std::uint32_t>(part.references.size()),
            static_cast<std::uint32_t>(cell.events.size())};
    for (const Event& event : cell.events.begins[0]) part.references.push_back(event.id);
    // In the scan's order, which is often one of neighbours.
    std::sort(part.references.begin() + node.first, part.references.end());
  }

  Cut best_cut(const Cell& cell) const {
    Cut best;
    const double area = half_area(cell.bounds);
    if (!(area > 0) || cell.events.size() == 0) return best;
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const std::vector<Event>&begins = cell.events.begins[axis], &ends = cell.events.ends[axis];
      const float lo = cell.bounds.lo[static_cast<int>(axis)], hi = cell.bounds.hi[static_cast<int>(axis)];
      const std::size_t count = begins.size();
      const auto consider = [&](float at, std::size_t below, std::size_t above, std::size_t planar,
                                bool planar_below) {
        if (at < lo || at > hi) return;
        // A cell without extent is there to take the boxes that lie in it.
        if ((at == lo || at == hi) && (!config_.flat_cells || planar == 0 || planar_below != (at == lo)))
          return;
        const auto [b, a] = halves(cell.bounds, axis, at);
        double cost =
            config_.intersection_cost *
            (half_area(b) * static_cast<double>(below) + half_area(a) * static_cast<double>(above)) / area;
        cost += config_.traversal_cost;
        if (below == 0 || above == 0) cost *= config_.empty_factor;
        if (cost < best.cost) best = {cost, at, axis, planar_below};
      };
      // At each position: boxes that begin before it, end at it or before, and lie in it.
      std::size_t begun = 0, ended = 0;
      while (begun < count || ended < count) {
        const float at =
            begun < count ? std::min(begins[begun].position, ends[ended].position) : ends[ended].position;
        const std::size_t before = begun;
        std::size_t planar = 0;
        for (; begun < count && begins[begun].position == at; ++begun) {
          planar += boxes_[begins[begun].id].hi[static_cast<int>(axis)] == at ? 1 : 0;
        }
        while (ended < count && ends[ended].position == at) ++ended;
        const std::size_t after = count - ended;  // they reach beyond
        consider(at, before + planar, after, planar, true);
        if (planar > 0) consider(at, before, after + planar, planar, false);
      }
    }
    return best;
  }

  std::pair<Cell, Cell> divide(Cell&& cell, const Cut& cut) const {
    std::pair<Cell, Cell> both;
    std::tie(both.first.bounds, both.second.bounds) = halves(cell.bounds, cut.axis, cut.position);
    both.first.depth = both.second.depth = cell.depth + 1;
    both.first.bad_cuts = both.second.bad_cuts = cell.bad_cuts;
    const int axis = static_cast<int>(cut.axis);
    const auto filter = [&](std::vector<Event>& from, std::vector<Event>& below, std::vector<Event>& above) {
      below.reserve(from.size());
      for (const Event& event : from) {
        const float lo = boxes_[event.id].lo[axis], hi = boxes_[event.id].hi[axis];
        const bool planar = lo == cut.position && hi == cut.position;
        if (lo < cut.position || (planar && cut.planar_below)) below.push_back(event);
        if (hi > cut.position || (planar && !cut.planar_below)) above.push_back(event);
      }
      std::vector<Event>().swap(from);
      if (below.size() * 2 < below.capacity()) below.shrink_to_fit();
    };
    for (std::size_t i = 0; i < 3; ++i) {
      filter(cell.events.begins[i], both.first.events.begins[i], both.second.events.begins[i]);
      filter(cell.events.ends[i], both.first.events.ends[i], both.second.events.ends[i]);
    }
    return both;
  }

  std::span<const Bounds3f> boxes_;
  const KdConfig& config_;
  const int max_depth_;
};

Cell whole_cell(std::span<const Bounds3f> boxes, const std::vector<std::uint32_t>& usable) {
  Cell cell;
  for (const std::uint32_t i : usable) cell.bounds.add(boxes[i]);
  parallel_for(6, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const int axis = static_cast<int>(i % 3);
      std::vector<Event>& events = i < 3 ? cell.events.begins[i] : cell.events.ends[i - 3];
      events.reserve(usable.size());
      for (const std::uint32_t id : usable) {
        events.push_back({i < 3 ? boxes[id].lo[axis] : boxes[id].hi[axis], id});
      }
      std::sort(events.begin(), events.end());
    }
  });
  return cell;
}

}  // namespace

KdTree build_kd_tree(std::span<const Bounds3f> boxes, const KdConfig& config) {
  RBVH_CHECK(boxes.size() < (1u << 29));
  const std::vector<std::uint32_t> usable = usable_boxes(boxes);
  KdTree tree;
  if (usable.empty()) return tree;
  Cell whole = whole_cell(boxes, usable);
  tree.bounds = whole.bounds;
  const Builder builder(boxes, config, usable.size());
  // The top by one thread, then the subtrees below it, each by one of its own.
  Part top;
  top.nodes.resize(1);
  std::vector<Builder::Later> later;
  builder.grow(std::move(whole), 0, top, &later);
  std::vector<Part> parts(later.size());
  parallel_for(later.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      parts[i].nodes.resize(1);
      builder.grow(std::move(later[i].cell), 0, parts[i], nullptr);
    }
  });
  tree.nodes = std::move(top.nodes);
  tree.references = std::move(top.references);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto base = static_cast<std::uint32_t>(tree.nodes.size() - 1);  // local node 1 goes to base + 1
    const auto references = static_cast<std::uint32_t>(tree.references.size());
    for (KdNode& node : parts[i].nodes) node.first += node.axis == kKdLeaf ? references : base;
    tree.nodes[later[i].node] = parts[i].nodes.front();
    tree.nodes.insert(tree.nodes.end(), parts[i].nodes.begin() + 1, parts[i].nodes.end());
    tree.references.insert(tree.references.end(), parts[i].references.begin(), parts[i].references.end());
    parts[i] = {};
  }
  return tree;
}

std::vector<Bounds3f> cells(const KdTree& tree) {
  std::vector<Bounds3f> boxes(tree.nodes.size());
  if (boxes.empty()) return boxes;
  boxes[0] = tree.bounds;
  // Children are numbered after their parents.
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const KdNode& node = tree.nodes[i];
    if (node.axis == kKdLeaf) continue;
    std::tie(boxes[node.first], boxes[node.first + 1]) = halves(boxes[i], node.axis, node.position);
  }
  return boxes;
}

double sah_cost(const KdTree& tree, const KdConfig& config) {
  if (tree.nodes.empty() || !(half_area(tree.bounds) > 0)) return 0;
  const std::vector<Bounds3f> boxes = cells(tree);
  double cost = 0;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const KdNode& node = tree.nodes[i];
    cost += half_area(boxes[i]) * (node.axis == kKdLeaf
                                       ? config.intersection_cost * static_cast<float>(node.count)
                                       : config.traversal_cost);
  }
  return cost / half_area(tree.bounds);
}

}  // namespace rbvh
