// Top down: a set of discs that one disc can stand for becomes that disc; any other is halved: by object, by
// the side that its discs face, at a depth step, or else at the median of its longest axis:
//
//    . . . . . . . .        . . . . : . . . .        ( merged ) : . : .
//    . . . . . . ./'   ->   . . . . : . . ./'   ->   (        ) : . : /
#include "pipeline/scan/merge_discs.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <span>

#include "pipeline/base/error.h"
#include "pipeline/scan/disc_tree.h"
#include "pipeline/scan/normals.h"
#include "pipeline/scan/radii.h"

namespace rbvh {
namespace {

/// Of positions, in radii.
constexpr double kRounding = 1e-5;
/// Points on the edge of a merged disc that are looked at.
constexpr int kEdgePoints = 12;
/// A disc around others reaches no further beyond them than this many sides of a square of their area:
/// further apart they are strewn, or lie along a line.
constexpr double kMostReach = 0.9;

using Set = std::span<std::uint32_t>;

struct Disc {
  Vec3d center, normal, color;
  double radius = 0;
};

class Merger {
 public:
  Merger(const Scan& cloud, std::span<const std::uint32_t> usable, const MergeConfig& config)
      : cloud_(cloud),
        config_(config),
        cosine_(std::cos(config.degrees * std::numbers::pi / 180)),
        side_(spacing_per_radius(cloud)),
        tree_(cloud, usable) {
    copy_attributes();
  }

  void merge(Set set) {
    if (set.empty()) return;
    if (set.size() == 1) return append_one(set[0]);
    if (const std::optional<Disc> disc = one_for(set)) return append(*disc, set);
    const std::size_t left = halve(set);
    merge(set.first(left));
    merge(set.subspan(left));
  }

  void append_one(std::uint32_t i) {
    result_.positions.push_back(cloud_.positions[i]);
    result_.normals.push_back(cloud_.normals[i]);
    result_.radii.push_back(cloud_.radii[i]);
    if (!cloud_.colors.empty()) result_.colors.push_back(cloud_.colors[i]);
    if (!cloud_.object_ids.empty()) result_.object_ids.push_back(cloud_.object_ids[i]);
    for (std::size_t p = 0; p < cloud_.properties.size(); ++p)
      result_.properties[p].values.push_back(cloud_.properties[p].values[i]);
  }

  MergeCounts counts;

  Scan take() { return std::move(result_); }

 private:
  void copy_attributes() {
    result_.shift = cloud_.shift;
    result_.viewpoints = cloud_.viewpoints;
    for (const ScalarProperty& property : cloud_.properties)
      result_.properties.push_back({property.name, {}});
  }

  Vec3d center(std::uint32_t i) const { return static_cast<Vec3d>(cloud_.positions[i]); }
  Vec3d normal(std::uint32_t i) const { return normalized(static_cast<Vec3d>(cloud_.normals[i])); }
  double radius(std::uint32_t i) const { return static_cast<double>(cloud_.radii[i]); }
  double area(std::uint32_t i) const { return side_ * side_ * radius(i) * radius(i); }
  Vec3d color(std::uint32_t i) const {
    if (cloud_.colors.empty()) return {};
    const Color8& c = cloud_.colors[i];
    return {static_cast<double>(c[0]), static_cast<double>(c[1]), static_cast<double>(c[2])};
  }

  Disc mean(Set set) const {
    Disc sum;
    double area_sum = 0;
    for (const std::uint32_t i : set) {
      area_sum += area(i);
      sum.center = sum.center + center(i) * area(i);
      sum.normal = sum.normal + normal(i) * area(i);
      sum.color = sum.color + color(i) * area(i);
    }
    return {sum.center * (1 / area_sum), normalized(sum.normal), sum.color * (1 / area_sum), 0};
  }

  /// The disc that the set can be merged to.
  std::optional<Disc> one_for(Set set) const {
    Disc disc = mean(set);
    double area_sum = 0, largest = 0;
    for (const std::uint32_t i : set) {
      const Vec3d d = center(i) - disc.center, tint = color(i) - disc.color;
      const double above = dot(d, disc.normal);
      if (std::abs(above) > config_.bound + kRounding * radius(i) || !agree(disc.normal, i) ||
          std::max({std::abs(tint.x), std::abs(tint.y), std::abs(tint.z)}) > config_.color ||
          object(i) != object(set[0]))
        return std::nullopt;
      disc.radius = std::max(disc.radius, length(d - disc.normal * above) + radius(i));
      largest = std::max(largest, radius(i));
      area_sum += area(i);
    }
    if (disc.radius > kMostReach * std::sqrt(area_sum) + largest || !is_on_surface(disc, largest))
      return std::nullopt;
    return disc;
  }

  /// A disc that leans further than normals may differ still lies within the bound where it is small.
  bool agree(const Vec3d& to, std::uint32_t i) const {
    const double cosine = dot(normal(i), to);
    return cosine >= cosine_ || (cosine > 0 && radius(i) * std::sqrt(1 - cosine * cosine) <= config_.bound);
  }

  /// A disc is round, the discs that it stands for are not: past them there must be others. Where the surface
  /// ends, it ends up to another disc's radius further out.
  bool is_on_surface(const Disc& disc, double largest) const {
    const Vec3d helper = std::abs(disc.normal.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
    const Vec3d u = normalized(cross(disc.normal, helper)), v = cross(disc.normal, u);
    for (int k = 0; k < kEdgePoints; ++k) {
      const double angle = 2 * std::numbers::pi * k / kEdgePoints;
      const Vec3d edge = disc.center + (u * std::cos(angle) + v * std::sin(angle)) * disc.radius;
      if (!tree_.covers(static_cast<Vec3f>(edge), static_cast<Vec3f>(disc.normal),
                        static_cast<float>(config_.bound + largest)))
        return false;
    }
    return true;
  }

  std::int32_t object(std::uint32_t i) const { return cloud_.object_ids.empty() ? 0 : cloud_.object_ids[i]; }

  /// Moves one half before the other, each in its order, and returns the first one's size.
  std::size_t halve(Set set) const {
    const auto move_first = [&](auto is_first) {
      return static_cast<std::size_t>(std::stable_partition(set.begin(), set.end(), is_first) - set.begin());
    };
    const std::int32_t id = object(set[0]);
    if (std::any_of(set.begin(), set.end(), [&](std::uint32_t i) { return object(i) != id; }))
      return move_first([&](std::uint32_t i) { return object(i) == id; });
    const Vec3d axis = mean(set).normal;
    const auto faces = [&](std::uint32_t i) { return dot(normal(i), axis) >= 0; };
    const std::size_t facing = move_first(faces);
    if (facing > 0 && facing < set.size()) return facing;

    // A depth step: nothing lies between two heights that are further apart than the bound.
    std::vector<double> heights;
    for (const std::uint32_t i : set) heights.push_back(dot(center(i), axis));
    std::sort(heights.begin(), heights.end());
    double gap = config_.bound, middle_of_gap = 0;
    for (std::size_t i = 0; i + 1 < heights.size(); ++i)
      if (heights[i + 1] - heights[i] > gap) {
        gap = heights[i + 1] - heights[i];
        middle_of_gap = (heights[i] + heights[i + 1]) / 2;
      }
    if (gap > config_.bound) {
      const std::size_t below =
          move_first([&](std::uint32_t i) { return dot(center(i), axis) < middle_of_gap; });
      if (below > 0 && below < set.size()) return below;
    }

    Bounds3d box;
    for (const std::uint32_t i : set) box.add(center(i));
    const Vec3d e = box.extent();
    const int along = e.x >= e.y && e.x >= e.z ? 0 : e.y >= e.z ? 1 : 2;
    const auto before = [&](std::uint32_t a, std::uint32_t b) {
      const float x = cloud_.positions[a][along], y = cloud_.positions[b][along];
      return x != y ? x < y : a < b;
    };
    std::vector<std::uint32_t> sorted(set.begin(), set.end());
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end(), before);
    return move_first([&](std::uint32_t i) { return before(i, *middle); });
  }

  void append(const Disc& disc, Set set) {
    result_.positions.push_back(static_cast<Vec3f>(disc.center));
    result_.normals.push_back(static_cast<Vec3f>(disc.normal));
    result_.radii.push_back(static_cast<float>(disc.radius));
    if (!cloud_.colors.empty()) {
      const auto byte = [](double value) { return static_cast<std::uint8_t>(std::lround(value)); };
      result_.colors.push_back({byte(disc.color.x), byte(disc.color.y), byte(disc.color.z)});
    }
    if (!cloud_.object_ids.empty()) result_.object_ids.push_back(object(set[0]));
    for (std::size_t p = 0; p < cloud_.properties.size(); ++p) {
      double sum = 0, area_sum = 0;
      for (const std::uint32_t i : set) {
        sum += static_cast<double>(cloud_.properties[p].values[i]) * area(i);
        area_sum += area(i);
      }
      result_.properties[p].values.push_back(static_cast<float>(sum / area_sum));
    }
    counts.discs += set.size();
    ++counts.merged;
  }

  const Scan& cloud_;
  const MergeConfig& config_;
  double cosine_;
  double side_;  ///< of the square that a disc stands for, in its radii: discs overlap
  DiscTree tree_;
  Scan result_;
};

}  // namespace

Scan merge_discs(const Scan& cloud, const MergeConfig& config, MergeCounts* counts) {
  const std::size_t count = cloud.positions.size();
  RBVH_CHECK(cloud.is_cloud() && cloud.normals.size() == count && cloud.radii.size() == count);
  std::vector<std::uint32_t> discs(count);
  std::iota(discs.begin(), discs.end(), 0u);
  const auto first_degenerate = std::stable_partition(discs.begin(), discs.end(), [&](std::uint32_t i) {
    return is_finite(cloud.positions[i]) && is_direction(cloud.normals[i]) && std::isfinite(cloud.radii[i]) &&
           cloud.radii[i] > 0;
  });
  const Set usable(discs.begin(), first_degenerate);
  Merger merger(cloud, usable, config);
  merger.merge(usable);
  for (auto i = first_degenerate; i != discs.end(); ++i) merger.append_one(*i);
  if (counts != nullptr) *counts = merger.counts;
  return merger.take();
}

}  // namespace rbvh
