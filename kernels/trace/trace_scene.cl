// Objects of several kinds in one scene. In rounds: rays meet a hierarchy over the instances' boxes, and the
// nearest few of those that each ray enters become pairs of ray and instance; pairs are sorted by object,
// their rays go into the instances' spaces, and one tracer after the other casts all of its own. Rays that
// come to another instance before what they hit go on.
//
// STACK: entries of the hierarchy's stack; MOST: pairs a ray and round.
#include "kernels/bvh/box.h"  // first: it says how floats are to be computed, rays too
#include "kernels/common/camera_rays.h"
#include "kernels/common/no_hit.h"
#include "kernels/common/object_ray.h"
#include "kernels/common/scene_layout.h"

#ifdef MOST
#include "kernels/trace/nearest_few.h"
#include "kernels/bvh/wide_node.h"

// Rays from `first` on.
__kernel void start_placing(__global Hit* hits, __global RayProgress* progress, __global uint* active,
                            uint first, uint count, __global uint* steps) {
  const uint at = (uint)get_global_id(0);
  if (at >= count) return;
  active[at] = first + at;
  hits[first + at] = no_hit();
  progress[first + at] = no_progress();
  if (steps) steps[first + at] = 0;
}

// The pairs of ray active[i] go behind each other, from pair_ranges[i].x on, .y of them; their keys are
// tracers.
__kernel void intersect_instances(__global const WideNode* nodes, BvhRoot top,
                                  __global const ScenePlacement* placements, __global const Ray* rays,
                                  __global const uint* active, uint count, uint most,
                                  __global const Hit* hits, __global RayProgress* progress,
                                  __global uint* pair_keys, __global uint* pair_rays,
                                  __global uint* pair_instances, __global uint* pair_places,
                                  __global uint2* pair_ranges, __global uint* pair_count,
                                  __global uint* steps) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  const uint r = active[i];
  const Ray ray = rays[r];
  const float limit = min(min(ray.tmax, FLT_MAX), hits[r].t);
  NearestFew few;
  few.after = progress[r];
  few.most = most;
  few.count = 0;
  uint visited = 0;
  Query q;
  if (prepare(&ray, &top, &q)) {
    uint stack[STACK], depth = 0, current = top.root;
    float stack_t[STACK];
    while (true) {
      ++visited;
      uint next = 0;
      if (current & BVH_LEAF_BIT) {
        const uint instance = current & ~BVH_LEAF_BIT;
        __global const ScenePlacement* placed = placements + instance;
        const float2 interval = box_interval(vload3(0, placed->lo), vload3(0, placed->hi), &q);
        if (interval.x <= min(interval.y, few_limit(&few, limit)) &&
            !is_done_with(&few, interval.x, instance))
          add_candidate(&few, interval.x, instance);
      } else {
        next = open_node(nodes + current, &q, few_limit(&few, limit), stack, stack_t, &depth);
      }
      if (next == 0) next = pop_nearer(stack, stack_t, &depth, few_limit(&few, limit));
      if (next == 0) break;
      current = next;
    }
  }
  const uint pairs = finish_candidates(&few, limit);
  uint first = 0;
  if (pairs > 0) first = atomic_add(pair_count, pairs);
  for (uint k = 0; k < pairs; ++k) {
    pair_keys[first + k] = placements[few.nearest[k].id].tracer;
    pair_rays[first + k] = r;
    pair_instances[first + k] = few.nearest[k].id;
    pair_places[first + k] = first + k;
  }
  pair_ranges[i] = (uint2)(first, pairs);
  progress[r] = progress_of(&few);
  if (steps) steps[r] += visited;
}

// Pairs [begin, begin + count) in sorted order: their rays, as the object sees them.
__kernel void place_rays(__global const uint* places, uint begin, uint count, __global const uint* pair_rays,
                         __global const uint* pair_instances, __global const ScenePlacement* placements,
                         __global const Ray* rays, __global const Hit* hits, __global Ray* placed) {
  const uint at = (uint)get_global_id(0);
  if (at >= count) return;
  const uint place = places[begin + at], r = pair_rays[place];
  Ray ray = rays[r];
  ray.tmax = min(ray.tmax, hits[r].t);
  const ScenePlacement placement = placements[pair_instances[place]];
  placed[at] = object_ray(placement.to_object, &ray);
}

__kernel void take_placed_hits(__global const uint* places, uint begin, uint count,
                               __global const uint* pair_rays, __global const uint* pair_instances,
                               __global const ScenePlacement* placements, __global const Ray* rays,
                               __global const Hit* placed, __global const uint* placed_steps,
                               __global Hit* pair_hits, __global uint* pair_steps) {
  const uint at = (uint)get_global_id(0);
  if (at >= count) return;
  const uint place = places[begin + at];
  if (pair_steps) pair_steps[place] = placed_steps[at];
  Hit hit = placed[at];
  if (hit.leaf != RBVH_NO_LEAF) {
    const ScenePlacement placement = placements[pair_instances[place]];
    const Ray ray = rays[pair_rays[place]];
    hit.leaf += placement.first_leaf;
    const float3 n = world_normal(placement.to_object, hit.normal, ray.direction);
    hit.normal[0] = n.x;
    hit.normal[1] = n.y;
    hit.normal[2] = n.z;
  }
  pair_hits[place] = hit;
}

// Each ray's nearest of its pairs' hits.
__kernel void take_nearest(__global const uint* active, uint count, uint any,
                           __global const uint2* pair_ranges, __global const Hit* pair_hits,
                           __global const uint* pair_steps, __global const RayProgress* progress,
                           __global Hit* hits, __global uint* next_active, __global uint* next_count,
                           __global uint* steps) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  const uint r = active[i];
  const uint2 range = pair_ranges[i];
  Hit hit = hits[r];
  uint nearest = RBVH_NO_LEAF, visited = 0;
  for (uint k = range.x; k < range.x + range.y; ++k) {
    const Hit other = pair_hits[k];
    if (steps) visited += pair_steps[k];
    if (other.t < hit.t || (other.t == hit.t && other.leaf < hit.leaf)) {
      hit = other;
      nearest = k;
    }
  }
  if (nearest != RBVH_NO_LEAF) hits[r] = hit;
  if (steps) steps[r] += visited;
  const float next_t = progress[r].next_t;
  if (next_t < INFINITY && hit.t >= next_t && !(any && hit.leaf != RBVH_NO_LEAF))
    next_active[atomic_inc(next_count)] = r;
}
#endif

// A camera's rays, row by row.
__kernel void write_camera_rays(CameraRays camera, __global Ray* rays) {
  const uint2 pixel = camera_pixel(camera.width, (uint)get_global_id(0));
  if (pixel.x >= camera.width || pixel.y >= camera.height) return;
  rays[pixel.y * camera.width + pixel.x] = camera_ray(&camera, pixel.x, pixel.y);
}
