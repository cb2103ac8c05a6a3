// Levels that are read when rays reach them, and leave by use: parts of a pair that is larger than memory.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/device/device.h"
#include "pipeline/scene/scene.h"
#include "pipeline/trace/trace_tile.h"

namespace rbvh {

class LevelResidency {
 public:
  /// At most scene.resident_bytes of levels at once; the one in use stays, whatever it takes. `scene` must
  /// outlive it.
  LevelResidency(const Device& device, const Scene& scene);

  /// The tracer of an object that is on demand, until the next call. Throws as its load() does.
  const Tracer& tracer_of(std::uint32_t object);
  bool has(std::uint32_t object) const { return residents_[object].tracer != nullptr; }
  std::uint64_t bytes() const { return bytes_; }
  std::uint64_t loads() const { return loads_; }

 private:
  struct Resident {
    std::unique_ptr<Level> level;
    std::unique_ptr<TileTracer> tracer;
    std::uint64_t last_use = 0;
  };
  void make_room(std::uint64_t bytes);

  Device device_;
  const Scene& scene_;
  std::vector<Resident> residents_;  ///< of each object
  std::uint64_t bytes_ = 0, uses_ = 0, loads_ = 0;
};

}  // namespace rbvh
