#include "pipeline/exact/sah_bvh.h"

#include <array>
#include <bit>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"

namespace rbvh {
namespace {

constexpr std::size_t kBins = 16;
constexpr std::size_t kBinningGrain = 1 << 16;  // elements binned by one thread at a time
constexpr int kMaxSahDepth = 64;                // below it sets are halved, so that the depth stays bounded

/// Four floats that compilers keep in one register; the fourth is not looked at.
struct Lanes {
  alignas(16) float v[4];
};
Lanes lower(const Lanes& a, const Lanes& b) {
  Lanes r;
  for (int i = 0; i < 4; ++i) r.v[i] = b.v[i] < a.v[i] ? b.v[i] : a.v[i];
  return r;
}
Lanes upper(const Lanes& a, const Lanes& b) {
  Lanes r;
  for (int i = 0; i < 4; ++i) r.v[i] = b.v[i] > a.v[i] ? b.v[i] : a.v[i];
  return r;
}

struct Box {
  Lanes lo{{3e38f, 3e38f, 3e38f, 0}}, hi{{-3e38f, -3e38f, -3e38f, 0}};

  void add(const Box& b) {
    lo = lower(lo, b.lo);
    hi = upper(hi, b.hi);
  }
  void add_point(const Lanes& p) {
    lo = lower(lo, p);
    hi = upper(hi, p);
  }
  float half_area() const {
    const float x = hi.v[0] - lo.v[0], y = hi.v[1] - lo.v[1], z = hi.v[2] - lo.v[2];
    return x * y + y * z + z * x;
  }
};

/// An element: its box, and its index in the unused lane, so that it moves as one cache line's half.
struct Element {
  Box box;
  std::uint32_t index() const { return std::bit_cast<std::uint32_t>(box.hi.v[3]); }
  /// Twice the centre.
  Lanes center() const {
    Lanes c;
    for (int i = 0; i < 4; ++i) c.v[i] = box.lo.v[i] + (i < 3 ? box.hi.v[i] : 0.0f);
    return c;
  }
};

/// A set of elements that is to become a subtree.
struct Range {
  std::size_t begin = 0, end = 0;
  Box bounds, centers;
  int depth = 0;
  std::size_t size() const { return end - begin; }
};

struct Bin {
  Box bounds;
  std::size_t count = 0;
};
using Bins = std::array<std::array<Bin, kBins>, 3>;

/// Maps a centre to its bin on every axis; an axis along which all centres agree has them in bin 0.
struct Binning {
  Lanes origin, scale;

  explicit Binning(const Box& centers) : origin(centers.lo) {
    for (int axis = 0; axis < 4; ++axis) {
      const float extent = axis < 3 ? centers.hi.v[axis] - centers.lo.v[axis] : 0.0f;
      const float bins_per_unit = static_cast<float>(kBins) * 0.9999f / extent;
      scale.v[axis] = extent > 0 && std::isfinite(bins_per_unit) ? bins_per_unit : 0.0f;
    }
  }
  std::array<std::uint32_t, 4> operator()(const Lanes& center) const {
    std::array<std::uint32_t, 4> bin;
    for (std::size_t axis = 0; axis < 4; ++axis) {
      bin[axis] = static_cast<std::uint32_t>(
          static_cast<std::int32_t>((center.v[axis] - origin.v[axis]) * scale.v[axis]));
    }
    return bin;
  }
};

void fill_bins(std::span<const Element> elements, const Binning& binning, Bins& bins) {
  for (const Element& element : elements) {
    const std::array<std::uint32_t, 4> bin = binning(element.center());
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Bin& b = bins[axis][std::min<std::size_t>(bin[axis], kBins - 1)];
      b.bounds.add(element.box);
      ++b.count;
    }
  }
}

struct Split {
  int axis = -1;        ///< -1: no plane separates the centres
  std::size_t bin = 0;  ///< the first one on the right
};

Split best_split(const Bins& bins, const Binning& binning, std::uint32_t test_width) {
  Split best;
  float best_cost = std::numeric_limits<float>::infinity();
  const auto tests = [&](std::size_t count) {
    return static_cast<float>((count + test_width - 1) / test_width);
  };
  for (int axis = 0; axis < 3; ++axis) {
    if (!(binning.scale.v[axis] > 0)) continue;
    const std::array<Bin, kBins>& row = bins[static_cast<std::size_t>(axis)];
    std::array<float, kBins> right_cost{};
    Box right;
    std::size_t right_count = 0;
    for (std::size_t i = kBins - 1; i > 0; --i) {
      right.add(row[i].bounds);
      right_count += row[i].count;
      right_cost[i] = right_count > 0 ? right.half_area() * tests(right_count) : -1.0f;
    }
    Box left;
    std::size_t left_count = 0;
    for (std::size_t i = 1; i < kBins; ++i) {
      left.add(row[i - 1].bounds);
      left_count += row[i - 1].count;
      if (left_count == 0 || right_cost[i] < 0) continue;
      const float cost = left.half_area() * tests(left_count) + right_cost[i];
      if (cost < best_cost) {
        best_cost = cost;
        best = {axis, i};
      }
    }
  }
  return best;
}

class Builder {
 public:
  Builder(std::vector<Element>& elements, const SahConfig& config) : elements_(elements), config_(config) {}

  bool is_leaf(const Range& range) const { return range.size() <= config_.leaf_size; }

  std::array<Range, 2> split(const Range& range, bool parallel) const {
    const Binning binning(range.centers);
    Bins bins{};
    if (parallel && range.size() > kBinningGrain) {
      std::vector<Bins> parts((range.size() + kBinningGrain - 1) / kBinningGrain);
      parallel_for(range.size(), kBinningGrain, [&](std::size_t begin, std::size_t end) {
        fill_bins(std::span(elements_).subspan(range.begin + begin, end - begin), binning,
                  parts[begin / kBinningGrain]);
      });
      for (const Bins& part : parts) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          for (std::size_t i = 0; i < kBins; ++i) {
            bins[axis][i].bounds.add(part[axis][i].bounds);
            bins[axis][i].count += part[axis][i].count;
          }
        }
      }
    } else {
      fill_bins(std::span(elements_).subspan(range.begin, range.size()), binning, bins);
    }
    const Split split = range.depth < kMaxSahDepth ? best_split(bins, binning, config_.test_width) : Split{};
    std::array<Range, 2> halves;
    std::size_t left = range.begin, right = range.end;
    const auto put = [&](Range& half, const Element& element) {
      half.bounds.add(element.box);
      half.centers.add_point(element.center());
    };
    if (split.axis < 0) {  // all centres agree, or too deep: halve the set as it lies
      left = right = range.begin + range.size() / 2;
      for (std::size_t i = range.begin; i < range.end; ++i) put(halves[i < left ? 0 : 1], elements_[i]);
    } else {
      const auto axis = static_cast<std::size_t>(split.axis);
      const auto is_left = [&](const Element& e) {
        return std::min<std::size_t>(binning(e.center())[axis], kBins - 1) < split.bin;
      };
      while (true) {
        for (; left < right && is_left(elements_[left]); ++left) put(halves[0], elements_[left]);
        for (; left < right && !is_left(elements_[right - 1]); --right) put(halves[1], elements_[right - 1]);
        if (left >= right) break;
        std::swap(elements_[left], elements_[right - 1]);
      }
    }
    RBVH_CHECK(left > range.begin && left < range.end);
    halves[0].begin = range.begin;
    halves[0].end = halves[1].begin = left;
    halves[1].end = range.end;
    halves[0].depth = halves[1].depth = range.depth + 1;
    return halves;
  }

  /// Writes the subtree over `range` into `nodes`, its root at nodes[root]. Sets of at most `stop` elements
  /// are put off: appended to `later` together with the node that waits for them.
  struct Later {
    Range range;
    std::size_t node;
  };
  void build(const Range& whole, std::size_t root, std::vector<BvhNode>& nodes, std::size_t stop,
             std::vector<Later>* later) const {
    std::vector<Later> stack = {{whole, root}};
    while (!stack.empty()) {
      const Later item = stack.back();
      stack.pop_back();
      BvhNode& node = nodes[item.node];
      const Box& b = item.range.bounds;
      node.bounds = {{b.lo.v[0], b.lo.v[1], b.lo.v[2]}, {b.hi.v[0], b.hi.v[1], b.hi.v[2]}};
      if (is_leaf(item.range)) {
        node.first = static_cast<std::uint32_t>(item.range.begin);
        node.count = static_cast<std::uint32_t>(item.range.size());
      } else if (later != nullptr && item.range.size() <= stop) {
        later->push_back(item);
      } else {
        const std::array<Range, 2> halves = split(item.range, later != nullptr);
        const std::size_t children = nodes.size();
        node.first = static_cast<std::uint32_t>(children);
        node.count = 0;
        nodes.resize(children + 2);
        stack.push_back({halves[1], children + 1});
        stack.push_back({halves[0], children});
      }
    }
  }

 private:
  std::vector<Element>& elements_;
  const SahConfig& config_;
};

bool usable(const Bounds3f& box) { return is_finite(box.lo) && is_finite(box.hi) && !box.empty(); }

}  // namespace

SahBvh build_sah_bvh(std::span<const Bounds3f> boxes, const SahConfig& config) {
  RBVH_CHECK(config.leaf_size > 0 && config.test_width > 0 && boxes.size() < (1u << 31));
  std::vector<Element> elements;
  elements.reserve(boxes.size());
  Range whole;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if (!usable(boxes[i])) continue;
    const Bounds3f& b = boxes[i];
    const float index = std::bit_cast<float>(static_cast<std::uint32_t>(i));
    elements.push_back({{{{b.lo.x, b.lo.y, b.lo.z, 0}}, {{b.hi.x, b.hi.y, b.hi.z, index}}}});
    whole.bounds.add(elements.back().box);
    whole.centers.add_point(elements.back().center());
  }
  SahBvh bvh;
  if (elements.empty()) return bvh;
  whole.end = elements.size();

  // The top by one thread, whose binning is shared out; the subtrees below it each by one thread of its own.
  // Where the one ends and the other begins depends on the number of elements alone.
  const Builder builder(elements, config);
  std::vector<Builder::Later> later;
  const std::size_t subtree = std::max<std::size_t>(4096, elements.size() / 64);
  bvh.nodes.resize(1);
  builder.build(whole, 0, bvh.nodes, subtree, &later);
  std::vector<std::vector<BvhNode>> subtrees(later.size());
  parallel_for(later.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      subtrees[i].resize(1);
      builder.build(later[i].range, 0, subtrees[i], 0, nullptr);
    }
  });
  for (std::size_t i = 0; i < later.size(); ++i) {
    const auto base = static_cast<std::uint32_t>(bvh.nodes.size() - 1);  // local node 1 goes to base + 1
    for (BvhNode& node : subtrees[i]) {
      if (node.count == 0) node.first += base;
    }
    bvh.nodes[later[i].node] = subtrees[i].front();
    bvh.nodes.insert(bvh.nodes.end(), subtrees[i].begin() + 1, subtrees[i].end());
    subtrees[i] = {};
  }
  bvh.order.resize(elements.size());
  for (std::size_t i = 0; i < elements.size(); ++i) bvh.order[i] = elements[i].index();
  return bvh;
}

}  // namespace rbvh
