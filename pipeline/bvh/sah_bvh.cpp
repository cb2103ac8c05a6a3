#include "pipeline/bvh/sah_bvh.h"

#include <algorithm>
#include <array>
#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/bvh/grow_bvh.h"

namespace rbvh {
namespace {

struct Plane {
  double cost = std::numeric_limits<double>::infinity();  ///< tests times half areas, both sides
  std::size_t left = 0;                                   ///< elements on the left
  int axis = 0;
};

class Sweep {
 public:
  Sweep(std::span<const Bounds3f> boxes, const std::vector<std::uint32_t>& usable, const BvhConfig& config,
        int sah_depth)
      : config_(config), sah_depth_(sah_depth), scratch_(usable.size()), is_right_(boxes.size()) {
    parallel_for(3, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t axis = begin; axis < end; ++axis) {
        std::vector<Element>& sorted = sorted_[axis];
        right_cost_[axis].resize(usable.size());
        sorted.reserve(usable.size());
        for (const std::uint32_t i : usable) sorted.push_back(Element::make(boxes[i], i));
        std::sort(sorted.begin(), sorted.end(), [axis](const Element& a, const Element& b) {
          const float ca = a.center().v[axis], cb = b.center().v[axis];
          return ca != cb ? ca < cb : a.index() < b.index();
        });
      }
    });
  }

  ElementRange whole() const {
    ElementRange range;
    range.end = sorted_[0].size();
    for (const Element& element : sorted_[0]) range.bounds.add(element.box);
    return range;
  }

  Halves split(const ElementRange& range, bool parallel) {
    if (range.size() == 1) return {};
    const Plane plane =
        range.depth < sah_depth_ ? best_plane(range, parallel) : Plane{0, (range.size() + 1) / 2, 0};
    if (range.size() <= config_.leaf_size) {
      const double area = range.bounds.half_area();
      const double inner = config_.traversal_cost * area + config_.intersection_cost * plane.cost;
      if (config_.leaf_cost(range.size()) * area <= inner) return {};
    }
    return divide(range, plane);
  }

  std::vector<std::uint32_t> order() const {
    std::vector<std::uint32_t> order(sorted_[0].size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = sorted_[0][i].index();
    return order;
  }

 private:
  Plane best_plane(const ElementRange& range, bool parallel) {
    std::array<Plane, 3> planes;
    const auto sweep = [&](std::size_t begin, std::size_t end) {
      for (std::size_t axis = begin; axis < end; ++axis) planes[axis] = best_plane_along(range, axis);
    };
    parallel ? parallel_for(3, 1, sweep) : sweep(0, 3);
    return *std::min_element(planes.begin(), planes.end(),
                             [](const Plane& a, const Plane& b) { return a.cost < b.cost; });
  }

  Plane best_plane_along(const ElementRange& range, std::size_t axis) {
    const Element* elements = &sorted_[axis][range.begin];
    double* right_cost = &right_cost_[axis][range.begin];
    const std::size_t n = range.size();
    const auto tests = [&](std::size_t count) {
      const std::size_t groups = (count + config_.test_width - 1) / config_.test_width;
      return static_cast<double>(groups);
    };
    Box right;
    for (std::size_t i = n - 1; i > 0; --i) {
      right.add(elements[i].box);
      right_cost[i] = static_cast<double>(right.half_area()) * tests(n - i);
    }
    Box left;
    Plane best;
    best.axis = static_cast<int>(axis);
    const auto off_middle = [n](std::size_t i) { return i > n - i ? i - (n - i) : n - i - i; };
    for (std::size_t i = 1; i < n; ++i) {
      left.add(elements[i - 1].box);
      const double cost = static_cast<double>(left.half_area()) * tests(i) + right_cost[i];
      // Of equally good ones the middle: duplicates would be peeled off one by one.
      if (cost < best.cost || (cost == best.cost && off_middle(i) < off_middle(best.left))) {
        best.cost = cost;
        best.left = i;
      }
    }
    if (best.left == 0) best.left = (n + 1) / 2;  // areas beyond float
    return best;
  }

  std::array<ElementRange, 2> divide(const ElementRange& range, const Plane& plane) {
    const std::vector<Element>& along = sorted_[static_cast<std::size_t>(plane.axis)];
    std::array<ElementRange, 2> halves;
    halves[0].begin = range.begin;
    halves[0].end = halves[1].begin = range.begin + plane.left;
    halves[1].end = range.end;
    for (std::size_t side = 0; side < 2; ++side) {
      halves[side].depth = range.depth + 1;
      for (std::size_t i = halves[side].begin; i < halves[side].end; ++i) {
        halves[side].bounds.add(along[i].box);
        is_right_[along[i].index()] = static_cast<std::uint8_t>(side);
      }
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (static_cast<int>(axis) == plane.axis) continue;
      std::vector<Element>& elements = sorted_[axis];
      std::size_t left = range.begin, right = range.begin;  // stable: the right ones wait aside
      for (std::size_t i = range.begin; i < range.end; ++i) {
        const Element element = elements[i];
        if (is_right_[element.index()]) {
          scratch_[right++] = element;
        } else {
          elements[left++] = element;
        }
      }
      RBVH_CHECK(left == halves[0].end);
      std::copy(scratch_.begin() + static_cast<std::ptrdiff_t>(range.begin),
                scratch_.begin() + static_cast<std::ptrdiff_t>(right),
                elements.begin() + static_cast<std::ptrdiff_t>(left));
    }
    return halves;
  }

  const BvhConfig& config_;
  const int sah_depth_;
  std::array<std::vector<Element>, 3> sorted_;     // the same elements in every range, by each axis
  std::array<std::vector<double>, 3> right_cost_;  // of the sets that begin at an element
  std::vector<Element> scratch_;
  std::vector<std::uint8_t> is_right_;  // by index of the box
};

}  // namespace

Bvh build_sah_bvh(std::span<const Bounds3f> boxes, const BvhConfig& config, int sah_depth) {
  RBVH_CHECK(config.leaf_size > 0 && config.test_width > 0 && boxes.size() < (1u << 31));
  const std::vector<std::uint32_t> usable = usable_boxes(boxes);
  Bvh bvh;
  if (usable.empty()) return bvh;
  Sweep sweep(boxes, usable, config, sah_depth);
  bvh.nodes = grow_bvh(sweep.whole(), [&sweep](const ElementRange& range, bool parallel) {
    return sweep.split(range, parallel);
  });
  bvh.order = sweep.order();
  return bvh;
}

}  // namespace rbvh
