#include "pipeline/measure/surface_distance.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"

namespace rbvh {
namespace {

double area(const Vec3f* corners) {
  const Vec3d a = static_cast<Vec3d>(corners[0]);
  return length(cross(static_cast<Vec3d>(corners[1]) - a, static_cast<Vec3d>(corners[2]) - a)) / 2;
}

}  // namespace

DistanceStatistics sampled_distance(const TriangleSoup& from, const ClosestPoint& to, std::size_t samples) {
  const std::size_t count = from.size() / 3;
  std::vector<double> area_before(count + 1, 0);
  for (std::size_t i = 0; i < count; ++i) area_before[i + 1] = area_before[i] + area(&from[3 * i]);
  if (!(area_before.back() > 0) || samples == 0) return {};
  std::vector<float> distances(samples);
  parallel_for(samples, 1 << 10, [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      // Even steps through the area; within the triangle the R2 sequence (Roberts 2018), folded.
      const double at = area_before.back() * (static_cast<double>(s) + 0.5) / static_cast<double>(samples);
      const auto above = std::upper_bound(area_before.begin(), area_before.end(), at);
      const std::size_t i =
          std::min<std::size_t>(count, static_cast<std::size_t>(above - area_before.begin())) - 1;
      double u = std::fmod(0.7548776662466927 * static_cast<double>(s + 1), 1.0);
      double v = std::fmod(0.5698402909980532 * static_cast<double>(s + 1), 1.0);
      if (u + v > 1) {
        u = 1 - u;
        v = 1 - v;
      }
      const Vec3f* t = &from[3 * i];
      const Vec3f point =
          t[0] + (t[1] - t[0]) * static_cast<float>(u) + (t[2] - t[0]) * static_cast<float>(v);
      distances[s] = to.distance(point);
    }
  });
  DistanceStatistics statistics;
  double squares = 0;
  for (const float d : distances) {
    squares += static_cast<double>(d) * static_cast<double>(d);
    statistics.max = std::max(statistics.max, static_cast<double>(d));
  }
  statistics.rms = std::sqrt(squares / static_cast<double>(samples));
  return statistics;
}

}  // namespace rbvh
