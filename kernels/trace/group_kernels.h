// The kernel that casts 16 rays a work-item, each by itself: what comes before and after the traversal is
// computed for all 16 at once. Beside what ray_kernels.h asks for, the file that includes this has defined
//   void make_hits16(tree, found, origin, direction, hits)   make_hit() for 16 rays.
#include "kernels/common/no_hit.h"
#include "kernels/trace/hit_lanes.h"
#include "kernels/bvh/ray_lanes.h"

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
  PreparedRay each[PACKET];
  Group group;
  group.lanes = &prepared;
  group.prepared = each;
  prepared_rays_of(&prepared, each);
  group.found =
      (Found16){min(lanes_of_rays.tmax, (float16)(FLT_MAX)), 0.0f, 0.0f, (uint16)(RBVH_NO_LEAF), 0u};
  group.nodes = group.leaves = 0;
  if (prepared.valid) {
    const uint one = lowest_bit(prepared.valid);
    for (uint axis = 0; axis < 3; ++axis) group.center[axis] = prepared.origin[axis][one];
    traverse_group(&tree, any, prepared.valid, &group);
  }
  HitLanes lanes;
  make_hits16(&tree, &group.found, lanes_of_rays.origin, lanes_of_rays.direction, &lanes);
  Hit made[PACKET];
  store_hits(&lanes, made);
  const uint16 visited = group.nodes + group.leaves;
  for (uint i = 0; i < used; ++i) {
    hits[first + i] = made[i];
    if (steps) steps[first + i] = OF_RAY(const uint, visited, i);
  }
}
