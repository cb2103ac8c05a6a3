#include "pipeline/bvh/sah_binned_bvh.h"

#include <array>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/bvh/grow_bvh.h"

namespace rbvh {
namespace {

constexpr std::size_t kBins = 16;
constexpr std::size_t kBinningGrain = 1 << 16;  // elements binned by one thread at a time
constexpr int kMaxSahDepth = 64;                // below it sets are halved, so that the depth stays bounded

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
  int axis = -1;                                        ///< -1: no plane separates the centres
  std::size_t bin = 0;                                  ///< the first one on the right
  float cost = std::numeric_limits<float>::infinity();  ///< tests times half areas, both sides
};

Split best_split(const Bins& bins, const Binning& binning, std::uint32_t test_width) {
  Split best;
  const auto tests = [&](std::size_t count) {
    const std::size_t whole = (count + test_width - 1) / test_width;
    return static_cast<float>(whole);
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
      if (cost < best.cost) best = {axis, i, cost};
    }
  }
  return best;
}

class Binner {
 public:
  Binner(std::vector<Element>& elements, const BvhConfig& config) : elements_(elements), config_(config) {}

  Halves split(const ElementRange& range, bool parallel) const {
    const float area = range.bounds.half_area();
    // A leaf that is one test cannot be bettered.
    if (range.size() == 1 || (range.size() <= config_.leaf_size && range.size() <= config_.test_width))
      return {};
    const Binning binning(range.centers);
    const Split split = range.depth < kMaxSahDepth
                            ? best_split(fill_all_bins(range, binning, parallel), binning, config_.test_width)
                            : Split{};
    if (range.size() <= config_.leaf_size) {
      const float inner = config_.traversal_cost * area + config_.intersection_cost * split.cost;
      if (config_.leaf_cost(range.size()) * area <= inner) return {};
    }
    return divide(range, binning, split);
  }

 private:
  Bins fill_all_bins(const ElementRange& range, const Binning& binning, bool parallel) const {
    Bins bins{};
    const std::span<const Element> elements = std::span(elements_).subspan(range.begin, range.size());
    if (!parallel || range.size() <= kBinningGrain) {
      fill_bins(elements, binning, bins);
      return bins;
    }
    std::vector<Bins> parts((range.size() + kBinningGrain - 1) / kBinningGrain);
    parallel_for(range.size(), kBinningGrain, [&](std::size_t begin, std::size_t end) {
      fill_bins(elements.subspan(begin, end - begin), binning, parts[begin / kBinningGrain]);
    });
    for (const Bins& part : parts) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        for (std::size_t i = 0; i < kBins; ++i) {
          bins[axis][i].bounds.add(part[axis][i].bounds);
          bins[axis][i].count += part[axis][i].count;
        }
      }
    }
    return bins;
  }

  std::array<ElementRange, 2> divide(const ElementRange& range, const Binning& binning,
                                     const Split& split) const {
    std::array<ElementRange, 2> halves;
    std::size_t left = range.begin, right = range.end;
    const auto put = [&](ElementRange& half, const Element& element) {
      half.bounds.add(element.box);
      half.centers.add_point(element.center());
    };
    if (split.axis < 0) {  // all centres agree, or too deep: halve the set as it lies
      left = range.begin + range.size() / 2;
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

  std::vector<Element>& elements_;
  const BvhConfig& config_;
};

}  // namespace

Bvh build_sah_binned_bvh(std::span<const Bounds3f> boxes, const BvhConfig& config) {
  RBVH_CHECK(config.leaf_size > 0 && config.test_width > 0 && boxes.size() < (1u << 31));
  std::vector<Element> elements;
  elements.reserve(boxes.size());
  ElementRange whole;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if (!is_usable(boxes[i])) continue;
    elements.push_back(Element::make(boxes[i], static_cast<std::uint32_t>(i)));
    whole.bounds.add(elements.back().box);
    whole.centers.add_point(elements.back().center());
  }
  Bvh bvh;
  if (elements.empty()) return bvh;
  whole.end = elements.size();
  const Binner binner(elements, config);
  bvh.nodes = grow_bvh(
      whole, [&binner](const ElementRange& range, bool parallel) { return binner.split(range, parallel); });
  bvh.order.resize(elements.size());
  for (std::size_t i = 0; i < elements.size(); ++i) bvh.order[i] = elements[i].index();
  return bvh;
}

}  // namespace rbvh
