#include "pipeline/measure/fidelity.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"

namespace rbvh {
namespace {

constexpr float kDepthTolerance = 0.01f;  // of the diagonal: beyond it a hit is on another piece of surface
constexpr std::size_t kRows = 16;         // a thread's piece of an image

bool is_hit(const Hit& hit) { return std::isfinite(hit.t); }

// The exact hits in the 3x3 pixels around (x, y), as far as they lie in the image.
struct Neighbourhood {
  int hits = 0, pixels = 0;
  float nearest = std::numeric_limits<float>::infinity(), farthest = 0;

  bool interior() const { return hits == 9; }
  bool has_edge() const { return hits > 0 && hits < pixels; }
};

Neighbourhood look_around(std::span<const Hit> exact, std::size_t width, std::size_t height, std::size_t x,
                          std::size_t y) {
  Neighbourhood n;
  for (std::size_t ny = y == 0 ? 0 : y - 1; ny <= std::min(height - 1, y + 1); ++ny)
    for (std::size_t nx = x == 0 ? 0 : x - 1; nx <= std::min(width - 1, x + 1); ++nx) {
      const Hit& hit = exact[ny * width + nx];
      ++n.pixels;
      if (!is_hit(hit)) continue;
      ++n.hits;
      n.nearest = std::min(n.nearest, hit.t);
      n.farthest = std::max(n.farthest, hit.t);
    }
  return n;
}

PixelFault fault_of(const Neighbourhood& around, const Hit& exact, const Hit& level, float tolerance) {
  if (around.interior()) {
    if (!is_hit(level)) return PixelFault::kHole;
    if (level.t > around.farthest + tolerance) return PixelFault::kLeak;
    if (level.t < around.nearest - tolerance) return PixelFault::kWall;
    return PixelFault::kNone;
  }
  if (is_hit(exact) == is_hit(level)) return PixelFault::kNone;
  return around.has_edge() ? PixelFault::kMaskAtSilhouette : PixelFault::kMaskElsewhere;
}

float degrees_between(const float a[3], const float b[3]) {
  const Vec3d u{a[0], a[1], a[2]}, v{b[0], b[1], b[2]};
  // atan2 keeps its precision near 0 and 180 degrees, where acos loses it.
  return static_cast<float>(std::atan2(length(cross(u, v)), dot(u, v)) * 180 / std::numbers::pi);
}

void add_view(ViewsFidelity& result, const HitFidelity& view) {
  result.views.push_back(view);
  HitFidelity& all = result.all;
  all.pixels += view.pixels;
  all.holes += view.holes;
  all.leaks += view.leaks;
  all.walls += view.walls;
  all.mismatches += view.mismatches;
  all.at_silhouette += view.at_silhouette;
  result.worst_holes = std::max(result.worst_holes, view.holes);
  result.worst_leaks = std::max(result.worst_leaks, view.leaks);
  result.worst_walls = std::max(result.worst_walls, view.walls);
}

}  // namespace

std::vector<PixelFault> find_faults(std::span<const Hit> exact, std::span<const Hit> level,
                                    std::uint32_t width, std::uint32_t height, float diagonal) {
  const std::size_t w = width, h = height;
  RBVH_CHECK(exact.size() == w * h && level.size() == w * h);
  std::vector<PixelFault> faults(w * h);
  parallel_for(h, kRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y)
      for (std::size_t x = 0; x < w; ++x) {
        const std::size_t i = y * w + x;
        faults[i] = fault_of(look_around(exact, w, h, x, y), exact[i], level[i], diagonal * kDepthTolerance);
      }
  });
  return faults;
}

Distribution distribution(std::vector<float>& values) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (values.empty()) return {kNone, kNone, kNone, kNone, kNone};
  auto sorted_to = values.begin();
  const auto at_rank = [&](double share) {
    const double rank = std::ceil(share * static_cast<double>(values.size()));
    const auto nth = values.begin() + std::max<std::ptrdiff_t>(0, static_cast<std::ptrdiff_t>(rank) - 1);
    std::nth_element(sorted_to, nth, values.end());
    sorted_to = nth;
    return static_cast<double>(*nth);
  };
  Distribution d;
  d.median = at_rank(0.5);
  d.p95 = at_rank(0.95);
  d.p99 = at_rank(0.99);
  d.p999 = at_rank(0.999);
  d.max = at_rank(1);
  return d;
}

HitFidelity compare_hits(std::span<const Hit> exact, std::span<const Hit> level, std::uint32_t width,
                         std::uint32_t height, float diagonal, HitDifferences* pool) {
  HitFidelity f;
  const std::vector<PixelFault> faults = find_faults(exact, level, width, height, diagonal);
  for (const PixelFault fault : faults) {
    f.holes += fault == PixelFault::kHole;
    f.leaks += fault == PixelFault::kLeak;
    f.walls += fault == PixelFault::kWall;
    f.at_silhouette += fault == PixelFault::kMaskAtSilhouette;
  }
  HitDifferences differences;
  for (std::size_t i = 0; i < exact.size(); ++i) {
    f.pixels += is_hit(exact[i]);
    f.mismatches += is_hit(exact[i]) != is_hit(level[i]);
    if (!is_hit(exact[i]) || !is_hit(level[i])) continue;
    differences.dt.push_back(std::abs(exact[i].t - level[i].t) / diagonal);
    differences.degrees.push_back(degrees_between(exact[i].normal, level[i].normal));
  }
  if (pool) {
    pool->dt.insert(pool->dt.end(), differences.dt.begin(), differences.dt.end());
    pool->degrees.insert(pool->degrees.end(), differences.degrees.begin(), differences.degrees.end());
  }
  f.dt = distribution(differences.dt);
  f.normal_degrees = distribution(differences.degrees);
  return f;
}

std::vector<ViewsFidelity> measure_views(const CastView& exact, std::span<const CastView> levels,
                                         const Bounds3f& bounds, const ViewsConfig& config,
                                         const Progress& progress,
                                         const std::function<void(const MeasuredView&)>& on_view) {
  const Bounds3d box = to_double(bounds);
  const std::vector<Camera> cameras = views_around(box, config.up_axis, config.views, 1);
  const float diagonal = bounds.diagonal();
  std::vector<ViewsFidelity> results(levels.size());
  std::vector<HitDifferences> pools(levels.size());
  for (int view = 0; view < config.views; ++view) {
    report(progress, "compare views", static_cast<double>(view) / config.views);
    const Camera& camera = cameras[static_cast<std::size_t>(view)];
    const CameraRays rays = camera_rays(camera, config.resolution, config.resolution);
    const std::vector<Hit> exact_hits = exact(rays);
    for (std::size_t i = 0; i < levels.size(); ++i) {
      const std::vector<Hit> hits = levels[i](rays);
      const HitFidelity f = compare_hits(exact_hits, hits, rays.width, rays.height, diagonal, &pools[i]);
      if (on_view) on_view({i, view, camera, rays, exact_hits, hits, f});
      add_view(results[i], f);
    }
  }
  for (std::size_t i = 0; i < levels.size(); ++i) {
    results[i].all.dt = distribution(pools[i].dt);
    results[i].all.normal_degrees = distribution(pools[i].degrees);
  }
  report(progress, "compare views", 1);
  return results;
}

}  // namespace rbvh
