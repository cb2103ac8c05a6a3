// The end of a round: each listed ray takes the nearest of its work items' hits, and goes on where its next
// target begins before that hit.
#include "kernels/common/ray_queue_layout.h"

// Equally near hits: the lowest leaf wins, so that results do not depend on the items' order. `steps`,
// `item_steps`: null, or visits to be summed up. `limits`: null, or what the items of a ray shared, to be
// reset. counts[COUNT_ACTIVE] grows by the rays that go on.
__kernel void take_nearest(__global const RayItems* listed, uint count, uint any,
                           __global const Hit* item_hits, __global const uint* item_steps,
                           __global const RayProgress* progress, __global uint* limits, __global Hit* hits,
                           __global uint* active, __global uint* counts, __global uint* steps) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  const RayItems ray = listed[i];
  const uint r = ray.ray;
  Hit hit = hits[r];
  bool nearer = false;
  uint visited = 0;
  for (uint k = ray.first; k < ray.first + ray.count; ++k) {
    if (steps) visited += item_steps[k];
    const Hit other = item_hits[k];
    if (other.t < hit.t || (other.t == hit.t && other.leaf < hit.leaf)) {
      hit = other;
      nearer = true;
    }
  }
  if (nearer) hits[r] = hit;
  if (steps) steps[r] += visited;
  if (limits) limits[r] = 0xffffffffu;
  const float next_t = progress[r].next_t;
  const bool goes_on = next_t < INFINITY && hit.t >= next_t && !(any && hit.leaf != RBVH_NO_LEAF);
  if (goes_on) active[atomic_inc(counts + COUNT_ACTIVE)] = r;
}
