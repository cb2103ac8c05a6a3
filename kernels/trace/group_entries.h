// The kernel that casts 16 rays a work-item, each by itself: what comes before and after the traversal is
// computed for all 16 at once. Beside what entries.h asks for, the file that
// includes this has defined
//   HitLanes, make_lanes(tree, found, d, lanes)   what hits need beside what was found; d: the directions
//   Hit lane_hit(tree, found, lanes, i, ray)      of a ray that hit.
#include "kernels/bvh/packet.h"
#include "kernels/common/no_hit.h"
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
  QueryLanes queries;
  prepare_lanes(&lanes_of_rays, &scene, &queries);
  FoundLanes found;
  uint hit = 0;  // as bits
  for (uint i = 0; i < PACKET; ++i) {
    Found nearest = {0.0f, 0.0f, 0.0f, RBVH_NO_LEAF, 0u};
    uint2 visited = (uint2)(0u);
    if (queries.valid >> i & 1) {
      Query q;
      query_of(&queries, i, &q);
      nearest.t = min(own[i].tmax, FLT_MAX);
      visited = traverse(&tree, &q, any, &nearest);
    }
    if (nearest.id != RBVH_NO_LEAF) hit |= 1u << i;
    found.t[i] = nearest.t;
    found.u[i] = nearest.u;
    found.v[i] = nearest.v;
    found.id[i] = nearest.id;
    found.at[i] = nearest.at;
    if (steps && i < used) steps[first + i] = visited.x + visited.y;
  }
  HitLanes lanes;
  if (hit != 0) make_lanes(&tree, &found, lanes_of_rays.direction, &lanes);
  for (uint i = 0; i < used; ++i)
    hits[first + i] = hit >> i & 1 ? lane_hit(&tree, &found, &lanes, i, &own[i]) : no_hit();
}
