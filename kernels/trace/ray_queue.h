// Work items of ray and target, as a search collects them for one round (pipeline/trace/ray_queue.h).
#ifndef RBVH_RAY_QUEUE_H
#define RBVH_RAY_QUEUE_H
#include "kernels/trace/nearest_few.h"

// Items lie behind each other in the order they come; keys and places are what is sorted: item places[i] has
// the i-th key. Rays that have items are listed.
typedef struct RayQueue {
  __global uint *keys, *places;
  __global WorkItem* items;
  __global RayItems* listed;
  __global uint* counts;  // COUNT_*
} RayQueue;

// The at-th of `count` pixels when squares of 4 x 4 are visited row by row. Incomplete squares at the right
// and below are smaller, and a last row that is cut off comes in order.
static inline uint square_pixel(uint at, uint count, uint row) {
  const uint band = at / (4 * row), in_band = at - 4 * row * band;
  const uint height = min(4u, (count - 4 * row * band) / row);
  if (in_band >= row * height) return at;
  const uint left = 4 * (in_band / (4 * height)), width = min(4u, row - left),
             in_square = in_band - left * height;
  return (4 * band + in_square / width) * row + left + in_square % width;
}

// How many rays a round has: without `active` those of the range begin.
static inline uint ray_count(__global const uint* active, __global const uint* counts, uint most_rays) {
  return active ? counts[COUNT_ACTIVE] : most_rays;
}

// The i-th of them.
static inline uint ray_number(__global const uint* active, RayRange range, uint i) {
  if (active) return active[i];
  if (range.row > 0) return range.first + square_pixel(i, range.count, range.row);
  return range.first + min(i * range.stride + range.stride / 2, range.count - 1);
}

// Lists ray r with `count` items, at least one; returns the place of the first.
static inline uint reserve_items(const RayQueue* queue, uint r, uint count) {
  const uint first = atomic_add(queue->counts + COUNT_ITEMS, count);
  const RayItems items = {r, first, count};
  queue->listed[atomic_inc(queue->counts + COUNT_LISTED)] = items;
  return first;
}

static inline void put_item(const RayQueue* queue, uint place, uint key, uint r, uint target) {
  const WorkItem item = {r, target};
  queue->keys[place] = key;
  queue->places[place] = place;
  queue->items[place] = item;
}
#endif
