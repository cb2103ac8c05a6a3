#include "pipeline/trace/patch_cache.h"

namespace rbvh {

std::uint32_t PatchCache::allocate(std::uint32_t patch, std::uint32_t blocks,
                                   const std::function<bool(const Entry&)>& is_needed,
                                   std::vector<Entry>& evicted) {
  if (blocks > capacity_) return kNone;
  const auto evict_within = [&](std::uint64_t begin, std::uint64_t end) {
    while (!entries_.empty() && entries_.front().at >= begin && entries_.front().at < end) {
      if (is_needed(entries_.front())) return false;
      evicted.push_back(entries_.front());
      used_ -= entries_.front().blocks;
      entries_.pop_front();
    }
    return true;
  };
  if (std::uint64_t{head_} + blocks > capacity_) {
    if (!evict_within(head_, capacity_)) return kNone;
    head_ = 0;
  }
  if (!evict_within(head_, std::uint64_t{head_} + blocks)) return kNone;
  const Entry entry = {patch, head_, blocks};
  entries_.push_back(entry);
  used_ += blocks;
  head_ += blocks;
  return entry.at;
}

}  // namespace rbvh
