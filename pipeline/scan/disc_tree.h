// Finds whether a cloud's discs cover a point.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// A balanced k-d tree without nodes: the middle of a range is its root, what is before and after it lies on
/// either side along its axis.
class DiscTree {
 public:
  /// Of these discs; none of their values is NaN.
  DiscTree(const Scan& cloud, std::span<const std::uint32_t> discs);

  /// Whether the point lies on a disc that faces as `normal` does, or no further than `beyond` from its edge
  /// or off its plane.
  bool covers(const Vec3f& point, const Vec3f& normal, float beyond) const;

 private:
  struct Range {
    std::size_t first, last;
  };
  void build(Range range);
  bool covers(Range range, const Vec3f& point, const Vec3f& normal, float beyond) const;

  const Scan& cloud_;
  std::vector<std::uint32_t> order_;
  std::vector<float> largest_;  ///< radius in the range whose middle this is
  std::vector<std::uint8_t> axes_;
};

}  // namespace rbvh
