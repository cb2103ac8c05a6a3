// Objects of several kinds in one scene: rays that meet an instance's box go into its space, a tracer of its kind casts
// them there, and what is nearer than before is taken over.
#include "exact_box.h"  // first: it says how floats are to be computed, rays too
#include "camera_rays.h"
#include "no_hit.h"
#include "object_ray.h"
#include "scene_layout.h"

__kernel void clear_hits(__global Hit* hits, uint count, __global uint* steps) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  hits[i] = no_hit();
  if (steps) steps[i] = 0;
}

// `ids` says whose ray each of those that go in is.
__kernel void place_rays(__global const Ray* rays, __global const Hit* hits, uint count, uint any,
                         ScenePlacement placement, __global Ray* placed, __global uint* ids,
                         __global uint* placed_count) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  Ray ray = rays[i];
  const Hit hit = hits[i];
  if (any && hit.leaf != RBVH_NO_LEAF) return;
  ray.tmax = min(ray.tmax, hit.t);
  ExactScene box;
  for (uint axis = 0; axis < 3; ++axis) {
    box.lo[axis] = placement.lo[axis];
    box.hi[axis] = placement.hi[axis];
  }
  Query q;
  if (!prepare(&ray, &box, &q)) return;
  const float2 interval =
      box_interval((float3)(box.lo[0], box.lo[1], box.lo[2]), (float3)(box.hi[0], box.hi[1], box.hi[2]), &q);
  if (!(interval.x <= min(interval.y, ray.tmax))) return;
  const uint at = atomic_inc(placed_count);
  placed[at] = object_ray(placement.to_object, &ray);
  ids[at] = i;
}

__kernel void take_placed_hits(__global const Hit* placed, __global const uint* ids, uint count,
                               ScenePlacement placement, __global const Ray* rays, __global Hit* hits,
                               __global const uint* placed_steps, __global uint* steps) {
  const uint at = (uint)get_global_id(0);
  if (at >= count) return;
  const uint i = ids[at];
  if (steps) steps[i] += placed_steps[at];
  Hit hit = placed[at];
  if (hit.leaf == RBVH_NO_LEAF) return;
  hit.leaf += placement.first_leaf;
  const Hit before = hits[i];
  if (!(hit.t < before.t || (hit.t == before.t && hit.leaf < before.leaf))) return;
  const Ray ray = rays[i];
  const float3 n = world_normal(placement.to_object, hit.normal, ray.direction);
  hit.normal[0] = n.x;
  hit.normal[1] = n.y;
  hit.normal[2] = n.z;
  hits[i] = hit;
}

// A camera's rays, row by row.
__kernel void write_camera_rays(CameraRays camera, __global Ray* rays) {
  const uint2 pixel = camera_pixel(camera.width, (uint)get_global_id(0));
  if (pixel.x >= camera.width || pixel.y >= camera.height) return;
  rays[pixel.y * camera.width + pixel.x] = camera_ray(&camera, pixel.x, pixel.y);
}
