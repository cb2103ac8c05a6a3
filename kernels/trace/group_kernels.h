// The kernel that casts 16 rays a work-item. What comes before and after the traversal is computed for all 16
// at once. Beside what ray_kernels.h asks for, the file that includes this has defined
//   void traverse_group(tree, any, rays, group),
//   void make_hits16(tree, found, origin, direction, hits)   make_hit() for 16 rays.
#include "kernels/bvh/group_traverse.h"
#include "kernels/common/no_hit.h"
#include "kernels/trace/hit_lanes.h"

static ALWAYS_INLINE void cast_group(const Tree* tree, const RayLanes* rays, uint any, Group* group) {
  prepare_lanes(rays, tree->scene, &group->lanes);
  prepared_rays_of(&group->lanes, group->prepared);
  group->found = (Found16){min(rays->tmax, (float16)(FLT_MAX)), 0.0f, 0.0f, (uint16)(RBVH_NO_LEAF), 0u};
  group->nodes = group->leaves = 0;
  const uint valid = group->lanes.valid;
  if (valid == 0) return;
  const uint one = lowest_bit(valid);
  for (uint axis = 0; axis < 3; ++axis) group->center[axis] = group->lanes.origin[axis][one];
  traverse_group(tree, any, valid, group);
}

__kernel void trace_ray_groups(TREE_ARGUMENTS, __global const Ray* rays, uint count, uint any,
                               __global Hit* hits, __global uint* steps BOUNDS_ARGUMENT) {
  const uint first = PACKET * (uint)get_global_id(0);
  if (first >= count) return;
  const uint used = min((uint)PACKET, count - first);
  const Tree tree = TREE;
  Ray own[PACKET];
  for (uint i = 0; i < used; ++i) own[i] = rays[first + i];
  RayLanes lanes;
  load_lanes(own, used, &lanes);
  Group group;
  cast_group(&tree, &lanes, any, &group);
  HitLanes hit_lanes;
  make_hits16(&tree, &group.found, lanes.origin, lanes.direction, &hit_lanes);
  Hit made[PACKET];
  store_hits(&hit_lanes, made);
  const uint16 visited = group.nodes + group.leaves;
  for (uint i = 0; i < used; ++i) {
    hits[first + i] = made[i];
    if (steps) steps[first + i] = OF_RAY(const uint, visited, i);
  }
}
