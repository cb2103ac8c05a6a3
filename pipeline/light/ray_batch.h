// Rays of any number, cast in one go, and the memory that they pass through.
#pragma once

#include <span>
#include <vector>

#include "pipeline/device/device.h"
#include "pipeline/trace/camera_rays.h"
#include "rbvh/tracer.h"

namespace rbvh {

/// Keeps its buffers from batch to batch.
struct RayBatch {
  Buffer<Ray> rays;
  CameraHits out;

  /// Valid until the next cast.
  const std::vector<Hit>& cast(const Tracer& tracer, std::span<const Ray> batch, RayQuery query) {
    if (rays.size() < batch.size()) rays = Buffer<Ray>(tracer.device, batch.size());
    if (out.on_device.size() < batch.size()) out.on_device = Buffer<Hit>(tracer.device, batch.size());
    out.hits.resize(batch.size());
    if (batch.empty()) return out.hits;
    rays.write(batch);
    tracer.intersect(rays, out.on_device, batch.size(), query);
    out.on_device.read(std::span(out.hits));
    return out.hits;
  }

  const std::vector<Hit>& cast(const Tracer& tracer, const CameraRays& camera) {
    intersect(tracer, camera, false, out);
    return out.hits;
  }
};

}  // namespace rbvh
