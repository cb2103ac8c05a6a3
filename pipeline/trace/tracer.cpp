#include "rbvh/tracer.h"

#include <algorithm>

#include "pipeline/device/device.h"
#include "pipeline/trace/camera_rays.h"

namespace rbvh {
namespace {

constexpr std::size_t kBatchRays = std::size_t{1} << 21;    // on the device at once
constexpr std::size_t kBandBytes = std::size_t{256} << 20;  // of a camera's hits on the device at once

}  // namespace

std::vector<Hit> intersect(const Tracer& tracer, std::span<const Ray> rays, RayQuery query,
                           std::vector<std::uint32_t>* steps) {
  const std::size_t batch = std::min(kBatchRays, std::max<std::size_t>(1, rays.size()));
  Buffer<Ray> ray_buffer(tracer.device, batch);
  const Buffer<Hit> hit_buffer(tracer.device, batch);
  const Buffer<std::uint32_t> step_buffer(tracer.device, steps ? batch : 0);
  std::vector<Hit> hits(rays.size());
  if (steps) steps->resize(rays.size());
  for (std::size_t first = 0; first < rays.size(); first += batch) {
    const std::size_t count = std::min(batch, rays.size() - first);
    ray_buffer.write(rays.subspan(first, count));
    tracer.intersect(ray_buffer, hit_buffer, count, query, steps ? &step_buffer : nullptr);
    hit_buffer.read(std::span(hits).subspan(first, count));
    if (steps) step_buffer.read(std::span(*steps).subspan(first, count));
  }
  return hits;
}

void intersect(const Tracer& tracer, const CameraRays& camera, bool count_steps, CameraHits& out) {
  const std::size_t width = camera.width, height = camera.height;
  const std::size_t band = std::clamp<std::size_t>(kBandBytes / (width * sizeof(Hit)), 1, height);
  if (out.on_device.size() < width * band) out.on_device = Buffer<Hit>(tracer.device, width * band);
  const Buffer<std::uint32_t> step_buffer(tracer.device, count_steps ? width * band : 0);
  out.hits.resize(width * height);
  out.steps.resize(count_steps ? width * height : 0);
  for (std::size_t row = 0; row < height; row += band) {
    const std::size_t rows = std::min(band, height - row), count = rows * width;
    CameraRays part = camera;
    part.offset_y += static_cast<float>(row);
    part.height = static_cast<std::uint32_t>(rows);
    tracer.intersect(part, out.on_device, count_steps ? &step_buffer : nullptr);
    out.on_device.read(std::span(out.hits).subspan(row * width, count));
    if (count_steps) step_buffer.read(std::span(out.steps).subspan(row * width, count));
  }
}

std::vector<Hit> intersect(const Tracer& tracer, const CameraRays& camera,
                           std::vector<std::uint32_t>* steps) {
  CameraHits out;
  intersect(tracer, camera, steps != nullptr, out);
  if (steps) *steps = std::move(out.steps);
  return std::move(out.hits);
}

std::vector<std::uint8_t> occluded(const Tracer& tracer, std::span<const Ray> rays) {
  const std::vector<Hit> hits = intersect(tracer, rays, RayQuery::kAny);
  std::vector<std::uint8_t> blocked(hits.size());
  std::transform(hits.begin(), hits.end(), blocked.begin(),
                 [](const Hit& hit) { return hit.leaf != RBVH_NO_LEAF; });
  return blocked;
}

}  // namespace rbvh
