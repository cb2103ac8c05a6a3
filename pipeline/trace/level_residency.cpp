#include "pipeline/trace/level_residency.h"

#include <algorithm>
#include <span>

#include "pipeline/base/error.h"

namespace rbvh {

LevelResidency::LevelResidency(const Device& device, const Scene& scene)
    : device_(device), scene_(scene), residents_(scene.objects.size()) {}

const Tracer& LevelResidency::tracer_of(std::uint32_t object) {
  Resident& resident = residents_[object];
  resident.last_use = ++uses_;
  if (resident.tracer != nullptr) return *resident.tracer;
  if (resident.spilled) {
    make_room(resident.tracer_bytes, object);
    resident.tracer = bring_back(*resident.spilled);
    if (resident.tracer != nullptr) return *resident.tracer;
    resident.spilled.reset();
  }
  if (resident.level == nullptr) load(object);
  resident.tracer = std::make_unique<TileTracer>(make_tile_tracer(device_, *resident.level));
  resident.tracer->level = nullptr;  // it may leave first
  resident.tracer_bytes = std::min(resident.tracer->memory(), whole_bytes(object));
  return *resident.tracer;
}

const Level& LevelResidency::level_of(std::uint32_t object) {
  Resident& resident = residents_[object];
  resident.last_use = ++uses_;
  if (resident.level == nullptr) load(object);
  return *resident.level;
}

void LevelResidency::load(std::uint32_t object) {
  const LevelOnDemand* level = scene_.objects[object].on_demand();
  RBVH_CHECK(level != nullptr);
  Resident& resident = residents_[object];
  make_room(level->bytes - (resident.tracer != nullptr ? resident.tracer_bytes : 0), object);
  resident.level = std::make_unique<Level>(level->load());
  ++loads_;
}

void LevelResidency::spill(Resident& resident) {
  if (resident.spilled) return;  // it is there, and does not change
  const TileTracer& tracer = *resident.tracer;
  const auto append = [&](const auto& buffer) {
    const auto values = buffer.read();
    return file_.append(std::as_bytes(std::span(values)));
  };
  const std::optional<std::uint64_t> offset = append(tracer.nodes);
  if (!offset || !append(tracer.tiles) || !append(tracer.heights) || !append(tracer.blocks)) return;
  resident.spilled = {
      tracer, tracer.nodes.size(), tracer.tiles.size(), tracer.heights.size(), tracer.blocks.size(), *offset};
  TileTracer& outline = resident.spilled->tracer;
  outline.nodes = {};
  outline.tiles = {};
  outline.heights = {};
  outline.blocks = {};
}

std::unique_ptr<TileTracer> LevelResidency::bring_back(const SpilledTracer& spilled) const {
  auto tracer = std::make_unique<TileTracer>(spilled.tracer);
  std::uint64_t offset = spilled.offset;
  const auto take = [&]<class T>(Buffer<T>& buffer, std::size_t count) {
    std::vector<T> values(count);
    const std::span<std::byte> bytes = std::as_writable_bytes(std::span(values));
    if (!file_.read(offset, bytes)) return false;
    offset += bytes.size();
    buffer = {device_, values};
    return true;
  };
  const bool is_whole = take(tracer->nodes, spilled.nodes) && take(tracer->tiles, spilled.tiles) &&
                        take(tracer->heights, spilled.heights) && take(tracer->blocks, spilled.blocks);
  return is_whole ? std::move(tracer) : nullptr;
}

std::uint64_t LevelResidency::bytes() const {
  std::uint64_t sum = 0;
  for (std::uint32_t i = 0; i < residents_.size(); ++i) {
    if (has_tracer(i)) sum += residents_[i].tracer_bytes;
    if (has_level(i)) sum += whole_bytes(i) - residents_[i].tracer_bytes;
  }
  return sum;
}

template <class Part>
LevelResidency::Resident* LevelResidency::oldest(std::unique_ptr<Part> Resident::*part,
                                                 std::uint32_t in_use) {
  Resident* result = nullptr;
  for (Resident& resident : residents_)
    if (&resident != &residents_[in_use] && resident.*part != nullptr &&
        (result == nullptr || resident.last_use < result->last_use))
      result = &resident;
  return result;
}

void LevelResidency::make_room(std::uint64_t wanted, std::uint32_t in_use) {
  bool is_finished = false;
  while (bytes() + wanted > scene_.resident_bytes) {
    if (Resident* of_level = oldest(&Resident::level, in_use)) {
      of_level->level.reset();
    } else if (Resident* of_tracer = oldest(&Resident::tracer, in_use)) {
      if (!is_finished) device_.finish();  // what was enqueued reads its buffers
      is_finished = true;
      spill(*of_tracer);
      of_tracer->tracer.reset();
    } else {
      return;
    }
  }
}

}  // namespace rbvh
