#include "rbvh/scan.h"

#include <utility>

#include "pipeline/scan/float_shift.h"
#include "pipeline/scan/precision.h"

namespace rbvh {
namespace {

/// Coordinates shift only where they are this many diagonals away: float then has fewer than 20 of its 24
/// bits for the shape.
constexpr double kShiftDiagonals = 16;

/// Whole units, or for a scan smaller than a unit a power of two below its diagonal: both print exactly.
double shift_grain(double diagonal) {
  if (diagonal >= 1) return 1;
  return std::exp2(std::floor(std::log2(diagonal)));
}

}  // namespace

Vec3d float_shift(const Bounds3d& box) {
  Vec3d shift{};
  if (box.empty()) return shift;
  const double diagonal = box.diagonal();
  double largest = 0;
  for (int axis = 0; axis < 3; ++axis)
    largest = std::max({largest, std::abs(box.lo[axis]), std::abs(box.hi[axis])});
  if (!(diagonal > 0) || !(largest > kShiftDiagonals * diagonal)) return shift;
  const double grain = shift_grain(diagonal);
  const Vec3d centre = box.center();
  for (int axis = 0; axis < 3; ++axis) shift[axis] = std::round(centre[axis] / grain) * grain;
  return shift;
}

Bounds3f bounds(const Scan& scan) {
  Bounds3f box;
  for (const Vec3f& p : scan.positions)
    if (is_finite(p)) box.add(p);
  return box;
}

Scan shift_to_float(RawScan&& raw) {
  const Vec3d shift = float_shift(near_bounds(raw.positions));

  Scan scan;
  scan.positions.resize(raw.positions.size());
  for (std::size_t i = 0; i < raw.positions.size(); ++i)
    scan.positions[i] = static_cast<Vec3f>(raw.positions[i] - shift);
  raw.positions = {};
  static_cast<ScanAttributes&>(scan) = std::move(static_cast<ScanAttributes&>(raw));
  scan.shift = raw.shift + shift;
  for (Viewpoint& viewpoint : scan.viewpoints) viewpoint.position = viewpoint.position - shift;
  return scan;
}

void move_to_shift(Scan& scan, const Vec3d& shift) {
  if (scan.shift == shift) return;
  const Vec3d difference = scan.shift - shift;
  for (Vec3f& p : scan.positions) p = Vec3f(Vec3d(p) + difference);
  scan.shift = shift;
}

}  // namespace rbvh
