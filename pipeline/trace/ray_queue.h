// Rays cast in rounds on the device, where a ray has several targets (a scene's instances, the patches of a
// mesh). Each round:
//   1. a search finds each ray's nearest few targets and makes work items of ray and target
//      (kernels/trace/ray_queue.h);
//   2. sort_items() sorts these by key, so that rays of one target lie together, and each target casts its
//   own;
//   3. take_nearest() gives each ray the nearest of its items' hits. Rays whose next target begins before
//   that hit
//      go on to the next round.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/common/ray_queue_layout.h"
#include "pipeline/device/device.h"

namespace rbvh {

/// Work items that are sorted on the host rather than by a dozen kernels, and rays whose number is not worth
/// waiting for.
inline constexpr std::uint32_t kFewItems = 4096;

/// Device memory for as many rays as reserve_queue() has been asked for.
struct RayQueue {
  Buffer<RayProgress> progress;  ///< a ray
  Buffer<std::uint32_t> active;  ///< rays that go on, after a round
  Buffer<RayItems> listed;       ///< rays that have work items
  Buffer<WorkItem> items;
  Buffer<std::uint32_t> keys, places;  ///< once sorted: item places[i] has the i-th key
  Buffer<Hit> item_hits;
  Buffer<std::uint32_t> item_steps;
  Buffer<std::uint32_t> counts[2];  ///< COUNTS, of even and of odd rounds

  std::vector<std::uint32_t> host_keys;    ///< after sort_items(): ascending
  std::vector<std::uint32_t> host_places;  ///< on their way to the device
};

/// For `rays` in all, of which `batch` are in rounds at once. True where memory was allocated.
bool reserve_queue(const Device& device, RayQueue& queue, std::size_t rays, std::size_t batch);

/// Work items a ray, of at most `most`, in a round that at most `active` rays go on in: one in the first, as
/// most rays hit the first target they reach; those that do not soon take all.
std::uint32_t items_per_ray(const RayQueue& queue, int round, std::uint32_t active, std::uint32_t most);

/// What a search gets as its list of rays: in round 0 none, as those of its range begin.
Buffer<std::uint32_t> active_rays(const RayQueue& queue, int round);

/// The counters of a round, for its search; in round 0 they are set to 0.
Buffer<std::uint32_t>& round_counts(RayQueue& queue, int round);

struct RoundCounts {
  std::uint32_t items, listed;
  std::uint32_t active;  ///< rays that went on; 0 in round 0
};
/// After the search. Waits for the device.
RoundCounts read_counts(RayQueue& queue, int round);

/// Reads the keys of a round's `items` into host_keys, in the order in which they came. After read_counts().
void read_keys(RayQueue& queue, std::uint32_t items);

/// Stable, by the lowest `key_bits` bits of the keys. After read_counts().
void sort_items(const Device& device, RayQueue& queue, std::uint32_t items, unsigned key_bits);

/// Where the run of equal keys that starts at `begin` ends.
inline std::uint32_t end_of_run(std::span<const std::uint32_t> keys, std::uint32_t begin) {
  return static_cast<std::uint32_t>(std::upper_bound(keys.begin() + begin, keys.end(), keys[begin]) -
                                    keys.begin());
}

/// `limits`: what the items of a ray shared, to be reset; may be empty, as may `steps`. Returns how many rays
/// go on, or an upper bound of at most kFewItems.
std::uint32_t take_nearest(const Device& device, RayQueue& queue, int round, std::uint32_t listed, bool any,
                           const Buffer<std::uint32_t>& limits, const Buffer<Hit>& hits,
                           const Buffer<std::uint32_t>& steps);

/// Bits that tell so many keys apart.
inline unsigned bits_for(std::uint64_t keys) {
  unsigned bits = 0;
  while (bits < 32 && keys > std::uint64_t{1} << bits) ++bits;
  return bits;
}

}  // namespace rbvh
