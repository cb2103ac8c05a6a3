#include "pipeline/trace/ray_queue.h"

#include <array>

#include "pipeline/device/radix_sort.h"

namespace rbvh {
namespace {

constexpr std::size_t kLeastItems = std::size_t{1} << 16;
constexpr std::size_t kGroup = 64;

}  // namespace

bool reserve_queue(const Device& device, RayQueue& queue, std::size_t rays, std::size_t batch) {
  const bool grows = rays > queue.progress.size();
  if (grows) queue.progress = {device, rays};
  batch = std::min(rays, batch);
  if (batch <= queue.active.size()) return grows;
  const std::size_t items = std::max(batch, kLeastItems);
  queue.active = {device, batch};
  queue.listed = {device, batch};
  queue.items = {device, items};
  queue.keys = {device, items};
  queue.places = {device, items};
  queue.item_hits = {device, items};
  queue.item_steps = {device, items};
  for (Buffer<std::uint32_t>& counts : queue.counts) counts = {device, COUNTS};
  return true;
}

std::uint32_t items_per_ray(const RayQueue& queue, int round, std::uint32_t active, std::uint32_t most) {
  const auto room = static_cast<std::uint32_t>(std::max<std::size_t>(1, queue.items.size() / active));
  return std::min({most, 1u << std::min(2 * round, 8), room});
}

Buffer<std::uint32_t> active_rays(const RayQueue& queue, int round) {
  return round == 0 ? Buffer<std::uint32_t>() : queue.active;
}

Buffer<std::uint32_t>& round_counts(RayQueue& queue, int round) {
  Buffer<std::uint32_t>& counts = queue.counts[round % 2];
  if (round == 0) counts.fill(0);
  return counts;
}

RoundCounts read_counts(RayQueue& queue, int round) {
  queue.host_keys.resize(std::min<std::size_t>(kFewItems, queue.keys.size()));
  queue.keys.enqueue_read(queue.host_keys);  // in most rounds that is all of them
  std::array<std::uint32_t, COUNTS> counts{};
  queue.counts[round % 2].read(counts);
  return {counts[COUNT_ITEMS], counts[COUNT_LISTED], counts[COUNT_ACTIVE]};
}

void read_keys(RayQueue& queue, std::uint32_t items) {
  const std::size_t read = queue.host_keys.size();
  queue.host_keys.resize(items);
  if (items > read) queue.keys.read(queue.host_keys);
}

void sort_items(const Device& device, RayQueue& queue, std::uint32_t items, unsigned key_bits) {
  std::vector<std::uint32_t>&keys = queue.host_keys, &places = queue.host_places;
  if (key_bits == 0) {
    keys.assign(items, 0);
    return;
  }
  if (items > kFewItems) {
    radix_sort(device, queue.keys, queue.places, items, key_bits);
    keys.resize(items);
    queue.keys.read(keys);
    return;
  }
  read_keys(queue, items);
  places.resize(items);
  for (std::uint32_t i = 0; i < items; ++i) places[i] = i;
  std::sort(places.begin(), places.end(),
            [&](std::uint32_t a, std::uint32_t b) { return keys[a] != keys[b] ? keys[a] < keys[b] : a < b; });
  std::sort(keys.begin(), keys.end());
  queue.places.enqueue_write(places);
}

std::uint32_t take_nearest(const Device& device, RayQueue& queue, int round, std::uint32_t listed, bool any,
                           const Buffer<std::uint32_t>& limits, const Buffer<Hit>& hits,
                           const Buffer<std::uint32_t>& steps) {
  Buffer<std::uint32_t>& next = queue.counts[(round + 1) % 2];
  next.fill(0);
  device.kernel("trace/ray_queue", "take_nearest")
      .run(listed, kGroup, queue.listed, listed, any ? 1u : 0u, queue.item_hits,
           steps.size() > 0 ? queue.item_steps : Buffer<std::uint32_t>(), queue.progress, limits, hits,
           queue.active, next, steps);
  if (listed <= kFewItems) return listed;
  std::uint32_t going_on = 0;
  next.read(std::span(&going_on, 1), COUNT_ACTIVE);
  return going_on;
}

}  // namespace rbvh
