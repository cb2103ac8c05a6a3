// The kernel that casts 16 rays a work-item, each by itself: what comes before and after the traversal is
// computed for all 16 at once. Beside what ray_kernels.h asks for, the file that includes this has defined
//   void make_hits16(tree, found, origin, direction, hits)   make_hit() for 16 rays.
#include "kernels/common/no_hit.h"
#include "kernels/trace/hit_lanes.h"
#include "kernels/trace/ray_lanes.h"

__kernel void trace_ray_groups(TREE_ARGUMENTS, __global const Ray* rays, uint count, uint any,
                               __global Hit* hits, __global uint* steps BOUNDS_ARGUMENT) {
  const uint first = PACKET * (uint)get_global_id(0);
  if (first >= count) return;
  const uint used = min((uint)PACKET, count - first);
  const Tree tree = TREE;
  Ray own[PACKET];
  for (uint i = 0; i < used; ++i) own[i] = rays[first + i];
  RayLanes lanes_of_rays;
  load_lanes(own, used, &lanes_of_rays);
  PreparedLanes prepared;
  prepare_lanes(&lanes_of_rays, &scene, &prepared);
  float t[PACKET], u[PACKET], v[PACKET];
  uint id[PACKET], place[PACKET];
  for (uint i = 0; i < PACKET; ++i) {
    Found nearest = {0.0f, 0.0f, 0.0f, RBVH_NO_LEAF, 0u};
    uint2 visited = (uint2)(0u);
    if (prepared.valid >> i & 1) {
      PreparedRay q;
      prepared_ray_of(&prepared, i, &q);
      nearest.t = min(own[i].tmax, FLT_MAX);
      visited = any ? occluded(&tree, &q, &nearest) : traverse(&tree, &q, 0, &nearest);
    }
    t[i] = nearest.t;
    u[i] = nearest.u;
    v[i] = nearest.v;
    id[i] = nearest.id;
    place[i] = nearest.at;
    if (steps && i < used) steps[first + i] = visited.x + visited.y;
  }
  const Found16 found = {vload16(0, t), vload16(0, u), vload16(0, v), vload16(0, id), vload16(0, place)};
  HitLanes lanes;
  make_hits16(&tree, &found, lanes_of_rays.origin, lanes_of_rays.direction, &lanes);
  Hit made[PACKET];
  store_hits(&lanes, made);
  for (uint i = 0; i < used; ++i) hits[first + i] = made[i];
}
