// Objects of several kinds in one scene, in rounds: rays intersect a hierarchy over the instances' boxes, and
// the nearest few instances that each ray enters become work items. Items are sorted by object, their rays
// are placed into the instances' spaces, and one tracer after the other casts all of its rays. Rays that
// enter another instance before their hit go on.
//
// STACK: entries of the hierarchy's stack; MOST: work items a ray and round.
#include "kernels/bvh/box.h"
#include "kernels/common/no_hit.h"
#include "kernels/common/object_ray.h"
#include "kernels/common/scene_layout.h"
#include "kernels/bvh/wide_node.h"
#include "kernels/trace/ray_queue.h"

// The nearest few instances that the ray enters before `limit`, up to few->most. Returns nodes and boxes
// visited.
static inline uint find_instances(__global const WideNode* nodes, const BvhRoot* top,
                                  __global const ScenePlacement* placements, const Ray* ray, float limit,
                                  NearestFew* few) {
  PreparedRay q;
  if (!prepare(ray, top, &q)) return 0;
  uint stack[STACK], depth = 0, current = top->root, visited = 0;
  float stack_t[STACK];
  while (true) {
    ++visited;
    uint next = 0;
    if (current & BVH_LEAF_BIT) {
      const uint instance = current & ~BVH_LEAF_BIT;
      __global const ScenePlacement* placed = placements + instance;
      const float2 interval = box_interval(vload3(0, placed->lo), vload3(0, placed->hi), &q);
      if (interval.x <= min(interval.y, few_limit(few, limit)) && !is_done_with(few, interval.x, instance))
        add_candidate(few, interval.x, instance);
    } else {
      next = open_node(nodes + current, &q, few_limit(few, limit), stack, stack_t, &depth);
    }
    if (next == 0) next = pop_nearer(stack, stack_t, &depth, few_limit(few, limit));
    if (next == 0) return visited;
    current = next;
  }
}

// Rays `active` go on from `progress` and `hits`; without it those of search.range begin, with nothing hit.
// Items' keys are tracers, their targets instances. `steps` may be null.
__kernel void search_instances(SceneSearch search, __global const WideNode* nodes,
                               __global const ScenePlacement* placements, __global const Ray* rays,
                               __global const uint* active, __global uint* keys, __global uint* places,
                               __global WorkItem* items, __global RayItems* listed, __global uint* counts,
                               __global RayProgress* progress, __global Hit* hits, __global uint* steps) {
  const uint i = (uint)get_global_id(0);
  if (i >= ray_count(active, counts, search.most_rays)) return;
  const RayQueue queue = {keys, places, items, listed, counts};
  const uint r = ray_number(active, search.range, i);
  const Ray ray = rays[r];
  const bool is_fresh = !active;
  const float limit = min(min(ray.tmax, FLT_MAX), is_fresh ? INFINITY : hits[r].t);
  NearestFew few;
  few.after = no_progress();
  if (!is_fresh) few.after = progress[r];
  few.most = search.most_items;
  few.count = 0;
  const uint visited = find_instances(nodes, &search.top, placements, &ray, limit, &few);
  if (is_fresh) hits[r] = no_hit();
  if (steps) steps[r] = visited + (is_fresh ? 0u : steps[r]);
  const uint count = finish_candidates(&few, limit);
  if (count == 0) return;
  const uint first = reserve_items(&queue, r, count);
  for (uint k = 0; k < count; ++k) {
    const uint instance = few.nearest[k].id;
    put_item(&queue, first + k, placements[instance].tracer, r, instance);
  }
  progress[r] = progress_of(&few);
}

// Work items [begin, begin + count) in sorted order: their rays in the objects' spaces.
__kernel void place_rays(__global const uint* places, uint begin, uint count, __global const WorkItem* items,
                         __global const ScenePlacement* placements, __global const Ray* rays,
                         __global const Hit* hits, __global Ray* placed) {
  const uint at = (uint)get_global_id(0);
  if (at >= count) return;
  const WorkItem item = items[places[begin + at]];
  Ray ray = rays[item.ray];
  ray.tmax = min(ray.tmax, hits[item.ray].t);
  const ScenePlacement placement = placements[item.target];
  placed[at] = object_ray(placement.to_object, &ray);
}

// Their hits, back in the world, and their steps where item_steps is given.
__kernel void collect_hits(__global const uint* places, uint begin, uint count,
                           __global const WorkItem* items, __global const ScenePlacement* placements,
                           __global const Ray* rays, __global const Hit* placed,
                           __global const uint* placed_steps, __global Hit* item_hits,
                           __global uint* item_steps) {
  const uint at = (uint)get_global_id(0);
  if (at >= count) return;
  const uint place = places[begin + at];
  const WorkItem item = items[place];
  if (item_steps) item_steps[place] = placed_steps[at];
  Hit hit = placed[at];
  if (hit.leaf != RBVH_NO_LEAF) {
    const ScenePlacement placement = placements[item.target];
    const Ray ray = rays[item.ray];
    hit.leaf += placement.first_leaf;
    const float3 n = world_normal(placement.to_object, hit.normal, ray.direction);
    hit.normal[0] = n.x;
    hit.normal[1] = n.y;
    hit.normal[2] = n.z;
  }
  item_hits[place] = hit;
}
