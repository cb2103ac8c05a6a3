#include "pipeline/measure/difference.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel_for.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/trace/camera_rays.h"

namespace rbvh {
namespace {

constexpr float kLeastShown = 1e-5f, kMostShown = 1e-2f;  // of the diagonal
constexpr Vec3f kBackground{0.94f, 0.94f, 0.94f}, kWarm{0.85f, 0.30f, 0.05f};

Vec3f fault_color(PixelFault fault) {
  switch (fault) {
    case PixelFault::kHole:
      return {1, 0, 0};
    case PixelFault::kLeak:
      return {1, 0, 1};
    case PixelFault::kWall:
      return {1, 0.9f, 0};
    case PixelFault::kMaskAtSilhouette:
      return {0.25f, 0.45f, 1};
    default:
      return {0, 0.7f, 0.2f};
  }
}

bool is_interior(PixelFault fault) {
  return fault == PixelFault::kHole || fault == PixelFault::kLeak || fault == PixelFault::kWall;
}

Vec3f surface_color(const Hit& exact, const Hit& level, Vec3f direction, float diagonal) {
  if (!std::isfinite(exact.t)) return kBackground;
  const Vec3f normal{exact.normal[0], exact.normal[1], exact.normal[2]};
  const float grey = 0.25f + 0.6f * std::abs(dot(normal, direction));
  float warmth = 0;
  if (std::isfinite(level.t)) {
    const float dt = std::max(std::abs(exact.t - level.t) / diagonal, kLeastShown);
    warmth = std::min(1.f, std::log(dt / kLeastShown) / std::log(kMostShown / kLeastShown));
  }
  return Vec3f{grey, grey, grey} * (1 - warmth) + kWarm * warmth;
}

}  // namespace

Image difference_image(std::span<const Hit> exact, std::span<const Hit> level, const CameraRays& rays,
                       float diagonal, int mark_radius) {
  const std::size_t width = rays.width, height = rays.height;
  const std::vector<PixelFault> faults = find_faults(exact, level, rays.width, rays.height, diagonal);
  Image image = make_image(Image::Kind::kShown, rays.width, rays.height, {"R", "G", "B"});
  const auto paint = [&](std::size_t x, std::size_t y, Vec3f color) {
    float* out = image.at(x, y);
    for (int c = 0; c < 3; ++c) out[c] = color[c];
  };
  parallel_for(height, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y)
      for (std::size_t x = 0; x < width; ++x) {
        const std::size_t i = y * width + x;
        const Vec3f direction =
            pixel_direction(rays, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
        paint(x, y,
              faults[i] == PixelFault::kNone ? surface_color(exact[i], level[i], direction, diagonal)
                                             : fault_color(faults[i]));
      }
  });
  const std::size_t radius = static_cast<std::size_t>(std::max(0, mark_radius));
  for (std::size_t y = 0; radius > 0 && y < height; ++y)
    for (std::size_t x = 0; x < width; ++x) {
      const PixelFault fault = faults[y * width + x];
      if (!is_interior(fault)) continue;
      for (std::size_t my = y - std::min(y, radius); my <= std::min(height - 1, y + radius); ++my)
        for (std::size_t mx = x - std::min(x, radius); mx <= std::min(width - 1, x + radius); ++mx)
          paint(mx, my, fault_color(fault));
    }
  return image;
}

Image render_difference(const Tracer& first, const Tracer& second, const Camera& camera, std::uint32_t width,
                        std::uint32_t height, float diagonal, std::uint64_t& differing,
                        RenderTimings* timings) {
  RenderTimings unasked;
  RenderTimings& times = timings != nullptr ? *timings : unasked;
  Stopwatch watch;
  const CameraRays rays = camera_rays(camera, width, height);
  const std::vector<Hit> a = intersect(first, rays), b = intersect(second, rays);
  times.trace += watch.lap();
  times.rays += a.size() + b.size();
  for (std::size_t i = 0; i < a.size(); ++i) differing += a[i].t != b[i].t || a[i].leaf != b[i].leaf;
  Image image = difference_image(a, b, rays, diagonal);
  times.shade += watch.lap();
  return image;
}

}  // namespace rbvh
