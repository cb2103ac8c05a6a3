#include "pipeline/trace/trace_footprint.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/trace/camera_rays.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 14;
/// A camera's rays take about this part of the time of as many other rays.
constexpr std::size_t kCameraGain = 5;
constexpr std::size_t kNowhere = std::numeric_limits<std::size_t>::max();

/// Where the ray enters the box, or infinity.
float entry(const Bounds3f& box, const Ray& ray) {
  float t0 = ray.tmin, t1 = ray.tmax;
  for (int axis = 0; axis < 3; ++axis) {
    const float inverse = 1 / (ray.direction[axis] == 0 ? 1e-30f : ray.direction[axis]);
    const float a = (box.lo[axis] - ray.origin[axis]) * inverse,
                b = (box.hi[axis] - ray.origin[axis]) * inverse;
    t0 = std::max(t0, std::min(a, b));
    t1 = std::min(t1, std::max(a, b));
  }
  return t0 <= t1 ? t0 : std::numeric_limits<float>::infinity();
}

struct Cast {
  std::vector<Hit> hits;
  std::vector<std::uint32_t> steps;
};

Cast cast(const TileTracer& tracer, std::span<const Ray> rays, RayQuery query, bool count_steps) {
  Cast result;
  if (!rays.empty()) result.hits = intersect(tracer, rays, query, count_steps ? &result.steps : nullptr);
  return result;
}

/// All of a camera's rays at one level: in beams where the device does that.
Cast cast(const TileTracer& tracer, const CameraRays& camera, bool count_steps) {
  Cast result;
  result.hits = intersect(tracer, camera, count_steps ? &result.steps : nullptr);
  return result;
}

/// `camera`: whose rays these are, or nullptr.
Cast cast_by_footprint(const FootprintTracer& tracer, std::span<const Ray> rays, const CameraRays* camera,
                       float spread, RayQuery query, bool count_steps) {
  const std::size_t coarsest = tracer.levels.size() - 1;
  const auto number = [&](Hit hit, std::size_t level) {
    if (hit.leaf != RBVH_NO_LEAF) hit.leaf += tracer.first_leaf[level];
    return hit;
  };
  Cast result = camera != nullptr ? cast(tracer.levels[coarsest], *camera, count_steps)
                                  : cast(tracer.levels[coarsest], rays, RayQuery::kNearest, count_steps);
  std::vector<std::size_t> wanted(rays.size());
  parallel_for(rays.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Ray& ray = rays[i];
      Hit& hit = result.hits[i];
      // What the coarsest level misses may be there in a finer one.
      const float t = std::isfinite(hit.t) ? hit.t : entry(tracer.bounds, ray);
      const float size = length(Vec3f{ray.direction[0], ray.direction[1], ray.direction[2]});
      wanted[i] = std::isfinite(t) ? level_for_width(tracer.texels, t * size * spread) : kNowhere;
      hit = number(hit, coarsest);
    }
  });
  for (std::size_t level = 0; level < coarsest; ++level) {
    std::vector<std::size_t> which;
    for (std::size_t i = 0; i < rays.size(); ++i)
      if (wanted[i] == level) which.push_back(i);
    const bool as_camera = camera != nullptr && which.size() > rays.size() / kCameraGain;
    Cast again;
    if (as_camera) {
      again = cast(tracer.levels[level], *camera, count_steps);
    } else {
      std::vector<Ray> some;
      some.reserve(which.size());
      for (const std::size_t i : which) some.push_back(rays[i]);
      again = cast(tracer.levels[level], some, query, count_steps);
    }
    for (std::size_t k = 0; k < which.size(); ++k) {
      const std::size_t from = as_camera ? which[k] : k;
      result.hits[which[k]] = number(again.hits[from], level);
      if (count_steps) result.steps[which[k]] += again.steps[from];
    }
  }
  return result;
}

void store(const Cast& cast, Buffer<Hit> hits, const Buffer<std::uint32_t>* steps) {
  hits.write(cast.hits);
  if (steps == nullptr) return;
  Buffer<std::uint32_t> to = *steps;
  to.write(cast.steps);
}

}  // namespace

FootprintTracer make_footprint_tracer(const Device& device, const Rbvh& rbvh, float spread) {
  FootprintTracer tracer(device);
  tracer.spread = spread;
  std::uint32_t leaves = 0;
  for (const Level& level : rbvh.levels) {
    tracer.levels.push_back(make_tile_tracer(device, level));
    tracer.texels.push_back(static_cast<float>(texel_side(level)));
    tracer.first_leaf.push_back(leaves);
    tracer.bounds.add(level.bounds);
    leaves += static_cast<std::uint32_t>(level.leaves.size());
  }
  return tracer;
}

std::size_t level_for_width(const std::vector<float>& texels, float width) {
  std::size_t level = texels.size() - 1;
  while (level > 0 && !(texels[level] <= width)) --level;
  return level;
}

void FootprintTracer::intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
                                RayQuery query, const Buffer<std::uint32_t>* steps) const {
  std::vector<Ray> list(count);
  rays.read(list);
  store(cast_by_footprint(*this, list, nullptr, spread, query, steps != nullptr), hits, steps);
}

void FootprintTracer::intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                                const Buffer<std::uint32_t>* steps) const {
  std::vector<Ray> rays;
  rays.reserve(std::size_t{camera.width} * camera.height);
  for (std::uint32_t y = 0; y < camera.height; ++y)
    for (std::uint32_t x = 0; x < camera.width; ++x) rays.push_back(pixel_ray(camera, x, y));
  const float pixel = length(Vec3f{camera.right[0], camera.right[1], camera.right[2]});
  store(cast_by_footprint(*this, rays, &camera, pixel, RayQuery::kNearest, steps != nullptr), hits, steps);
}

/// Level by level, with the others' hits taken for misses.
SurfaceSamples FootprintTracer::surface(std::span<const Hit> hits, float of_rays) const {
  SurfaceSamples all;
  all.normals.resize(hits.size());
  for (std::size_t i = 0; i < levels.size(); ++i) {
    std::vector<Hit> own(hits.begin(), hits.end());
    for (Hit& hit : own) {
      const bool is_own = hit.leaf != RBVH_NO_LEAF && level_of_leaf(*this, hit.leaf) == i;
      if (is_own)
        hit.leaf -= first_leaf[i];
      else
        hit.t = std::numeric_limits<float>::infinity();
    }
    const SurfaceSamples some = levels[i].surface(own, of_rays);
    if (!some.colors.empty()) all.colors.resize(hits.size());
    for (std::size_t k = 0; k < own.size(); ++k) {
      if (!std::isfinite(own[k].t)) continue;
      all.normals[k] = some.normals[k];
      if (!some.colors.empty()) all.colors[k] = some.colors[k];
    }
  }
  return all;
}

std::uint64_t FootprintTracer::memory() const {
  std::uint64_t bytes = 0;
  for (const TileTracer& level : levels) bytes += level.memory();
  return bytes;
}

std::size_t level_of_leaf(const FootprintTracer& tracer, std::uint32_t leaf) {
  const auto above = std::upper_bound(tracer.first_leaf.begin(), tracer.first_leaf.end(), leaf);
  return static_cast<std::size_t>(above - tracer.first_leaf.begin()) - 1;
}

}  // namespace rbvh
