// Levels that are read when rays reach them, and leave by use: parts of a pair that is larger than memory.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "pipeline/base/spill_file.h"
#include "pipeline/device/device.h"
#include "pipeline/scene/scene.h"
#include "pipeline/trace/trace_tile.h"

namespace rbvh {

/// Of each object two things are kept apart: the level, for what is asked about hits, and what rays are cast
/// at, which takes ten times as long to make and a quarter of the memory. Levels leave first. What rays are
/// cast at leaves for a file, and comes back from there.
class LevelResidency {
 public:
  /// At most scene.resident_bytes at once; what is in use stays, whatever it takes. `scene` must outlive it.
  LevelResidency(const Device& device, const Scene& scene);

  /// To cast rays at an object that is on demand, until the next call. Throws as its load() does.
  const Tracer& tracer_of(std::uint32_t object);
  bool has_tracer(std::uint32_t object) const { return residents_[object].tracer != nullptr; }
  /// To ask about its hits, until the next call.
  const Level& level_of(std::uint32_t object);
  bool has_level(std::uint32_t object) const { return residents_[object].level != nullptr; }

  std::uint64_t bytes() const;
  /// So often a level was read.
  std::uint64_t loads() const { return loads_; }

 private:
  struct SpilledTracer {
    TileTracer tracer;  ///< without its buffers
    std::size_t nodes, tiles, heights, blocks;
    std::uint64_t offset;  ///< of these in the file, one after the other
  };
  struct Resident {
    std::unique_ptr<Level> level;
    std::unique_ptr<TileTracer> tracer;
    std::uint64_t tracer_bytes = 0;  ///< known once one has been made; the rest is the level's
    std::optional<SpilledTracer> spilled;
    std::uint64_t last_use = 0;
  };
  std::uint64_t whole_bytes(std::uint32_t object) const { return scene_.objects[object].on_demand()->bytes; }
  void load(std::uint32_t object);
  /// Where that did not work out, the tracer is made anew.
  void spill(Resident& resident);
  std::unique_ptr<TileTracer> bring_back(const SpilledTracer& spilled) const;
  void make_room(std::uint64_t wanted, std::uint32_t in_use);
  /// Of those that have such a part, the one that was used the longest ago; none: no other has.
  template <class Part>
  Resident* oldest(std::unique_ptr<Part> Resident::*part, std::uint32_t in_use);

  Device device_;
  const Scene& scene_;
  std::vector<Resident> residents_;  ///< of each object
  SpillFile file_;
  std::uint64_t uses_ = 0, loads_ = 0;
};

}  // namespace rbvh
