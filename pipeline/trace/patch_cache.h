// Which patch hierarchies are on the device, and where: a ring of bounded size in which the newest takes the
// place of the oldest. Knows sizes and places only; the memory is the tracer's.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <vector>

namespace rbvh {

class PatchCache {
 public:
  /// Of so many blocks.
  explicit PatchCache(std::uint32_t capacity = 0) : capacity_(capacity) {}

  struct Entry {
    std::uint32_t patch, at, blocks;
  };

  /// A place for `blocks`, or kNone where that would take one that `is_needed`. Those whose place it takes go
  /// to `evicted`.
  std::uint32_t allocate(std::uint32_t patch, std::uint32_t blocks,
                         const std::function<bool(const Entry&)>& is_needed, std::vector<Entry>& evicted);
  static constexpr std::uint32_t kNone = 0xffffffffu;

  std::uint32_t capacity() const { return capacity_; }
  std::uint64_t used() const { return used_; }  ///< blocks, those no longer wanted too
  void clear() {
    entries_.clear();
    head_ = 0;
    used_ = 0;
  }

 private:
  std::uint32_t capacity_ = 0, head_ = 0;
  std::uint64_t used_ = 0;
  std::deque<Entry>
      entries_;  ///< oldest first; the oldest is the first at or after the head, around the ring
};

}  // namespace rbvh
