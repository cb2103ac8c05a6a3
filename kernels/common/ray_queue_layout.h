// Rays that are cast in rounds: where each stands, and the work items of ray and target that a round
// collects; shared with the host (pipeline/trace/ray_queue.h).
#ifndef RBVH_RAY_QUEUE_LAYOUT_H
#define RBVH_RAY_QUEUE_LAYOUT_H

#include "kernels/common/layout.h"

#ifndef __OPENCL_VERSION__
namespace rbvh {
#endif

// The rays that a cast begins with: of `count` from `first` on every stride-th. `row`: they are an image's,
// that many pixels wide, and are visited in squares of 4 x 4; 0: in order.
typedef struct RayRange {
  rbvh_u32 first, count, stride, row;
  rbvh_u32 keep_hits;  // hits of other objects are there already
} RayRange;
RBVH_LAYOUT_SIZE(RayRange, 20);

// How far a ray has come among its targets, nearest first: those that it enters up to (t, id) are done with;
// it enters the next one at next_t.
typedef struct RayProgress {
  float t;
  rbvh_u32 id;
  float next_t;
} RayProgress;
RBVH_LAYOUT_SIZE(RayProgress, 12);

// A ray that is to be cast at a target: an instance, or a patch of an instance.
typedef struct WorkItem {
  rbvh_u32 ray;
  rbvh_u32 target;
} WorkItem;
RBVH_LAYOUT_SIZE(WorkItem, 8);

// A ray's work items of a round: `count` from place `first` on.
typedef struct RayItems {
  rbvh_u32 ray;
  rbvh_u32 first, count;
} RayItems;
RBVH_LAYOUT_SIZE(RayItems, 12);

// What a round counts.
#define COUNT_ITEMS 0
#define COUNT_LISTED 1  // rays that have work items
#define COUNT_ACTIVE 2  // rays that go on from the round before
#define COUNTS 3

#ifndef __OPENCL_VERSION__
}  // namespace rbvh
#endif
#endif
