// Allocates the device's memory for patch hierarchies: a ring of bounded size in which the newest replace the
// oldest. It tracks sizes and places only; the memory is the caller's.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <vector>

namespace rbvh {

class PatchCache {
 public:
  /// `capacity`: in blocks.
  explicit PatchCache(std::uint32_t capacity = 0) : capacity_(capacity) {}

  struct Entry {
    std::uint32_t patch, at, blocks;
  };

  /// A place for `blocks`, or kNone where that would evict one that `is_needed`. Evicted entries go to
  /// `evicted`.
  std::uint32_t allocate(std::uint32_t patch, std::uint32_t blocks,
                         const std::function<bool(const Entry&)>& is_needed, std::vector<Entry>& evicted);
  static constexpr std::uint32_t kNone = 0xffffffffu;

  std::uint32_t capacity() const { return capacity_; }
  std::uint64_t used() const { return used_; }  ///< blocks, those of unwanted levels included
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
