#include "pipeline/exact/trace_exact.h"

#include <chrono>
#include <string>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/exact/flatten_exact.h"
#include "pipeline/exact/sah_binned_bvh.h"

namespace rbvh {
namespace {

constexpr std::size_t kGroup = 64;

Kernel kernel_of(const ExactTracer& tracer, const char* entry) {
  return tracer.device.kernel("trace_exact", entry,
                              "-DSTACK=" + std::to_string(tracer.stack) + (tracer.discs ? " -DDISCS" : ""));
}

}  // namespace

ExactTracer make_exact_tracer(const Device& device, const Scan& scan, ExactTimings* timings) {
  using Clock = std::chrono::steady_clock;
  auto last = Clock::now();
  const auto lap = [&last] {
    const auto now = Clock::now();
    return std::chrono::duration<double>(now - std::exchange(last, now)).count();
  };
  RBVH_CHECK(!scan.is_cloud() ||
             (scan.normals.size() == scan.positions.size() && scan.radii.size() == scan.positions.size()));
  ExactTimings times;
  const Bvh bvh = build_sah_binned_bvh(primitive_bounds(scan), {EXACT_BLOCK_WIDTH, EXACT_BLOCK_WIDTH});
  times.hierarchy = lap();
  const ExactLayout layout = flatten_exact(bvh, scan);
  times.flatten = lap();
  ExactTracer tracer{device, scan.is_cloud(), layout.scene, {device, layout.nodes}, {device, layout.blocks},
                     0};
  constexpr std::uint32_t kStackStep = 128;  // few sizes: each is a kernel of its own
  tracer.stack = (layout.stack + kStackStep - 1) / kStackStep * kStackStep;
  times.upload = lap();
  if (timings != nullptr) *timings = times;
  return tracer;
}

void trace_rays(const ExactTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps) {
  RBVH_CHECK(rays.size() >= count && hits.size() >= count && (steps == nullptr || steps->size() >= count));
  const std::uint32_t any = query == RayQuery::kAny ? 1 : 0;
  kernel_of(tracer, "trace_exact_rays")
      .run(count, kGroup, tracer.nodes, tracer.blocks, tracer.scene, rays, static_cast<std::uint32_t>(count),
           any, hits, steps != nullptr ? *steps : Buffer<std::uint32_t>());
}

void trace_camera(const ExactTracer& tracer, const CameraRays& camera, const Buffer<Hit>& hits,
                  const Buffer<std::uint32_t>* steps) {
  const std::size_t pixels = std::size_t{camera.width} * camera.height;
  RBVH_CHECK(hits.size() >= pixels && (steps == nullptr || steps->size() >= pixels));
  const std::size_t squares = std::size_t{(camera.width + 7) / 8} * ((camera.height + 7) / 8);
  kernel_of(tracer, "trace_exact_camera")
      .run(squares * 64, kGroup, tracer.nodes, tracer.blocks, tracer.scene, camera, hits,
           steps != nullptr ? *steps : Buffer<std::uint32_t>());
}

}  // namespace rbvh
