#include "pipeline/trace/ray_table.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/stopwatch.h"
#include "pipeline/device/device.h"
#include "rbvh/geometry.h"

namespace rbvh {
namespace {

constexpr std::size_t kBatch = std::size_t{1} << 21;  // rays on the device at once
// Squared lengths outside these would overflow or vanish in the kernels' own arithmetic.
constexpr float kLeastSquare = 1e-20f, kMostSquare = 1e20f;

/// A ray as the kernels can take it; t of its hits times `scale` is t as the user has it.
struct PreparedRay {
  Ray ray{};
  float scale = 1;
  bool usable = false;  // finite, with a direction
};

PreparedRay prepare_ray(const float* row, std::size_t columns) {
  PreparedRay p;
  Ray& ray = p.ray;
  std::copy(row, row + 3, ray.origin);
  std::copy(row + 3, row + 6, ray.direction);
  ray.tmin = columns == 8 ? row[6] : 0;
  ray.tmax = columns == 8 ? row[7] : std::numeric_limits<float>::infinity();
  const Vec3d d{static_cast<double>(row[3]), static_cast<double>(row[4]), static_cast<double>(row[5])};
  const double size = length(d);
  p.usable = is_finite(Vec3f{row[0], row[1], row[2]}) && is_finite(d) && size > 0 && !std::isnan(ray.tmin) &&
             !std::isnan(ray.tmax);
  if (p.usable && !(size * size >= kLeastSquare && size * size <= kMostSquare)) {
    for (int axis = 0; axis < 3; ++axis) ray.direction[axis] = static_cast<float>(d[axis] / size);
    ray.tmin = static_cast<float>(ray.tmin * size);
    ray.tmax = static_cast<float>(ray.tmax * size);
    p.scale = static_cast<float>(1 / size);
  }
  if (!p.usable) ray = {{0, 0, 0}, 1, {0, 0, 1}, 0};  // an empty interval: hits nothing
  return p;
}

void store(const Hit& hit, const PreparedRay& ray, float* row) {
  const bool found = ray.usable && std::isfinite(hit.t);
  row[0] = found ? hit.t * ray.scale : std::numeric_limits<float>::infinity();
  for (int axis = 0; axis < 3; ++axis) row[1 + axis] = found ? hit.normal[axis] : 0;
  row[4] = found ? hit.u : 0;
  row[5] = found ? hit.v : 0;
  row[6] = found ? static_cast<float>(hit.leaf) : -1;
  row[7] = found ? static_cast<float>(hit.flags & RBVH_HIT_FLAGS) : 0;
}

}  // namespace

std::vector<float> trace_table(const Tracer& tracer, std::span<const float> rays, std::size_t columns,
                               RayQuery query, const Progress& progress, RayTableCounts* counts) {
  RayTableCounts unasked;
  RayTableCounts& sum = counts != nullptr ? *counts : unasked;
  const std::size_t rows = rays.size() / columns, batch = std::min(kBatch, std::max<std::size_t>(1, rows));
  std::vector<float> table(rows * kHitColumns);
  Buffer<Ray> ray_buffer(tracer.device, batch);
  const Buffer<Hit> hit_buffer(tracer.device, batch);
  std::vector<PreparedRay> prepared(batch);
  std::vector<Ray> sent(batch);
  std::vector<Hit> hits(batch);
  for (std::size_t first = 0; first < rows; first += batch) {
    report(progress, "trace", static_cast<double>(first) / static_cast<double>(rows));
    const std::size_t count = std::min(batch, rows - first);
    for (std::size_t i = 0; i < count; ++i) {
      prepared[i] = prepare_ray(&rays[(first + i) * columns], columns);
      sent[i] = prepared[i].ray;
      sum.unusable += !prepared[i].usable;
    }
    ray_buffer.write(std::span(sent).first(count));
    Stopwatch watch;
    tracer.intersect(ray_buffer, hit_buffer, count, query);
    tracer.device.finish();
    sum.seconds += watch.lap();
    hit_buffer.read(std::span(hits).first(count));
    for (std::size_t i = 0; i < count; ++i) {
      float* row = &table[(first + i) * kHitColumns];
      store(hits[i], prepared[i], row);
      sum.hits += row[6] >= 0;
    }
  }
  return table;
}

}  // namespace rbvh
