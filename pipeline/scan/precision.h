// Whether a file's coordinates are as fine as its points are near, and which of its points lie nowhere near
// the others.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// The middle of most points and how far they spread, in double: the median and the interquartile range of
/// each coordinate, of a sample. Nothing for few points, or where a quarter of them or more are equal.
struct Spread {
  Vec3d middle;
  double range = 0;  ///< the interquartile box's diagonal
  bool is_within(const Vec3d& p, double ranges) const { return length(p - middle) <= ranges * range; }
};
std::optional<Spread> spread_of(std::span<const Vec3d> positions);

/// What a shift is chosen by: the box of the finite points, without those that are so far from the others
/// (such as 0 0 0 among UTM coordinates) that float32 could not hold both finely.
Bounds3d near_bounds(std::span<const Vec3d> positions);

/// Points farther than this many interquartile ranges from the middle are called far.
inline constexpr double kFarRanges = 1e4;
std::size_t count_far(std::span<const Vec3d> positions);

/// Makes the far points NaN, so that cleaning removes them; how many.
std::size_t drop_far(RawScan& scan);

/// How far apart float32's numbers are at coordinates of this size.
double float_step(double size);

/// A sentence each: how many points are far, and that coordinates were rounded to float32 before they came
/// here, in steps wider than the points are apart.
std::vector<std::string> precision_notes(const RawScan& scan);

}  // namespace rbvh
