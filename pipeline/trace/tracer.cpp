#include "pipeline/trace/tracer.h"

#include <algorithm>

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

std::vector<Hit> intersect(const Tracer& tracer, const CameraRays& camera,
                           std::vector<std::uint32_t>* steps) {
  const std::size_t width = camera.width, height = camera.height;
  const std::size_t band = std::clamp<std::size_t>(kBandBytes / (width * sizeof(Hit)), 1, height);
  const Buffer<Hit> hit_buffer(tracer.device, width * band);
  const Buffer<std::uint32_t> step_buffer(tracer.device, steps ? width * band : 0);
  std::vector<Hit> hits(width * height);
  if (steps) steps->resize(width * height);
  for (std::size_t row = 0; row < height; row += band) {
    const std::size_t rows = std::min(band, height - row), count = rows * width;
    CameraRays part = camera;
    part.offset_y += static_cast<float>(row);
    part.height = static_cast<std::uint32_t>(rows);
    tracer.intersect(part, hit_buffer, steps ? &step_buffer : nullptr);
    hit_buffer.read(std::span(hits).subspan(row * width, count));
    if (steps) step_buffer.read(std::span(*steps).subspan(row * width, count));
  }
  return hits;
}

std::vector<std::uint8_t> occluded(const Tracer& tracer, std::span<const Ray> rays) {
  const std::vector<Hit> hits = intersect(tracer, rays, RayQuery::kAny);
  std::vector<std::uint8_t> blocked(hits.size());
  std::transform(hits.begin(), hits.end(), blocked.begin(),
                 [](const Hit& hit) { return hit.leaf != RBVH_NO_LEAF; });
  return blocked;
}

}  // namespace rbvh
