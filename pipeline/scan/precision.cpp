#include "pipeline/scan/precision.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace rbvh {
namespace {

constexpr std::size_t kSample = 8191, kFewest = 8;
/// The rest of a scan lies within this many interquartile ranges of its middle.
constexpr double kNearRanges = 100;

bool is_far(const Spread& spread, const Vec3d& p) { return is_finite(p) && !spread.is_within(p, kFarRanges); }

}  // namespace

std::optional<Spread> spread_of(std::span<const Vec3d> positions) {
  const std::size_t step = std::max<std::size_t>(1, positions.size() / kSample);
  std::vector<Vec3d> sample;  // without 0 0 0, by which scanners say that there is no point
  for (std::size_t i = 0; i < positions.size(); i += step)
    if (is_finite(positions[i]) && positions[i] != Vec3d{}) sample.push_back(positions[i]);
  if (sample.size() < kFewest) return std::nullopt;
  Spread spread;
  Vec3d range;
  std::vector<double> values(sample.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < sample.size(); ++i) values[i] = sample[i][axis];
    std::sort(values.begin(), values.end());
    spread.middle[axis] = values[values.size() / 2];
    range[axis] = values[3 * values.size() / 4] - values[values.size() / 4];
  }
  spread.range = length(range);
  if (!(spread.range > 0) || !std::isfinite(spread.range)) return std::nullopt;
  return spread;
}

Bounds3d near_bounds(std::span<const Vec3d> positions) {
  const std::optional<Spread> spread = spread_of(positions);
  Bounds3d box;
  for (const Vec3d& p : positions)
    if (is_finite(p) && (!spread || spread->is_within(p, kNearRanges))) box.add(p);
  return box;
}

std::size_t count_far(std::span<const Vec3d> positions) {
  const std::optional<Spread> spread = spread_of(positions);
  if (!spread) return 0;
  return static_cast<std::size_t>(
      std::count_if(positions.begin(), positions.end(), [&](const Vec3d& p) { return is_far(*spread, p); }));
}

std::size_t drop_far(RawScan& scan) {
  const std::optional<Spread> spread = spread_of(scan.positions);
  if (!spread) return 0;
  std::size_t dropped = 0;
  for (Vec3d& p : scan.positions) {
    if (!is_far(*spread, p)) continue;
    p.x = std::numeric_limits<double>::quiet_NaN();
    ++dropped;
  }
  return dropped;
}

double float_step(double size) {
  const auto edge = static_cast<float>(size);
  return static_cast<double>(std::nextafter(edge, std::numeric_limits<float>::infinity())) -
         static_cast<double>(edge);
}

std::vector<std::string> precision_notes(const RawScan& scan) {
  std::vector<std::string> notes;
  if (const std::size_t far = count_far(scan.positions); far > 0) {
    const Spread spread = *spread_of(scan.positions);
    const Vec3d first = *std::find_if(scan.positions.begin(), scan.positions.end(),
                                      [&](const Vec3d& p) { return is_far(spread, p); });
    notes.push_back(fmt::format("{} {} far from all the others, the first at {:g} {:g} {:g}: invalid points?",
                                far, far == 1 ? "point lies" : "points lie", first.x, first.y, first.z));
  }
  // Whole numbers are floats, too, but were not rounded to them.
  bool is_float = true, is_whole = true;
  for (const Vec3d& p : scan.positions)
    for (int axis = 0; axis < 3 && is_float; ++axis) {
      is_float &= !std::isfinite(p[axis]) || static_cast<double>(static_cast<float>(p[axis])) == p[axis];
      is_whole &= p[axis] == std::floor(p[axis]);
    }
  if (!is_float || is_whole) return notes;
  const Bounds3d box = near_bounds(scan.positions);
  if (box.empty()) return notes;
  double extents[3], largest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    extents[axis] = box.hi[axis] - box.lo[axis];
    largest = std::max({largest, std::abs(box.lo[axis]), std::abs(box.hi[axis])});
  }
  std::sort(extents, extents + 3);
  const double spacing = std::sqrt(extents[1] * extents[2] / static_cast<double>(scan.positions.size()));
  const double grain = float_step(largest);
  if (grain > spacing && spacing > 0)
    notes.push_back(fmt::format(
        "the coordinates are 32-bit floats, coarser ({:.2g}) at this distance from the origin than "
        "the points are apart ({:.2g}): export them as doubles, or nearer to the origin",
        grain, spacing));
  return notes;
}

}  // namespace rbvh
