#include "pipeline/trace/level_residency.h"

#include <algorithm>

#include "pipeline/base/error.h"

namespace rbvh {

LevelResidency::LevelResidency(const Device& device, const Scene& scene)
    : device_(device), scene_(scene), residents_(scene.objects.size()) {}

const Tracer& LevelResidency::tracer_of(std::uint32_t object) {
  Resident& resident = residents_[object];
  resident.last_use = ++uses_;
  if (resident.tracer != nullptr) return *resident.tracer;
  const LevelOnDemand* level = scene_.objects[object].on_demand();
  RBVH_CHECK(level != nullptr);
  make_room(level->bytes);
  resident.level = std::make_unique<Level>(level->load());
  resident.tracer = std::make_unique<TileTracer>(make_tile_tracer(device_, *resident.level));
  bytes_ += level->bytes;
  ++loads_;
  return *resident.tracer;
}

void LevelResidency::make_room(std::uint64_t bytes) {
  while (bytes_ > 0 && bytes_ + bytes > scene_.resident_bytes) {
    std::size_t oldest = residents_.size();
    for (std::size_t i = 0; i < residents_.size(); ++i)
      if (residents_[i].tracer != nullptr &&
          (oldest == residents_.size() || residents_[i].last_use < residents_[oldest].last_use))
        oldest = i;
    device_.finish();  // what was enqueued reads its buffers
    residents_[oldest].tracer.reset();
    residents_[oldest].level.reset();
    bytes_ -= scene_.objects[oldest].on_demand()->bytes;
  }
}

}  // namespace rbvh
