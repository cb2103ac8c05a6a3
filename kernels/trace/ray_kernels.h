// The kernels that cast one ray a work-item, the same for all tracers. The file that includes this has
// defined
//   Tree, TREE_ARGUMENTS, TREE              what rays are cast at, the arguments it is made of, and how,
//   uint2 traverse(tree, q, any, found)     the traversal; returns nodes and leaves visited,
//   Hit make_hit(tree, found, ray).
#include "kernels/common/bounds.h"
#include "kernels/common/camera_rays.h"

// Nearest hit, or any if `any` is set. Returns nodes and leaves visited.
static inline uint2 trace(const Tree* tree, const Ray* ray, uint any, Found* found) {
  *found = (Found){min(ray->tmax, FLT_MAX), 0.0f, 0.0f, RBVH_NO_LEAF, 0u};
  PreparedRay q;
  if (!prepare(ray, tree->scene, &q)) return (uint2)(0u);
  return traverse(tree, &q, any, found);
}

__kernel void trace_rays(TREE_ARGUMENTS, __global const Ray* rays, uint count, uint any, __global Hit* hits,
                         __global uint* steps BOUNDS_ARGUMENT) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  const Tree tree = TREE;
  const Ray ray = rays[i];
  Found found;
  const uint2 visited = trace(&tree, &ray, any, &found);
  hits[i] = make_hit(&tree, &found, &ray);
  if (steps) steps[i] = visited.x + visited.y;
}

__kernel void trace_camera(TREE_ARGUMENTS, CameraRays camera, __global Hit* hits,
                           __global uint* steps BOUNDS_ARGUMENT) {
  const uint2 pixel = camera_pixel(camera.width, (uint)get_global_id(0));
  if (pixel.x >= camera.width || pixel.y >= camera.height) return;
  const Tree tree = TREE;
  const Ray ray = camera_ray(&camera, pixel.x, pixel.y);
  Found found;
  const uint2 visited = trace(&tree, &ray, 0, &found);
  const size_t i = (size_t)pixel.y * camera.width + pixel.x;
  hits[i] = make_hit(&tree, &found, &ray);
  if (steps) steps[i] = visited.x + visited.y;
}

// Nodes and leaves visited apart, for benchmarks.
__kernel void trace_visits(TREE_ARGUMENTS, __global const Ray* rays, uint count, uint any,
                           __global uint2* visits BOUNDS_ARGUMENT) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  const Tree tree = TREE;
  const Ray ray = rays[i];
  Found found;
  visits[i] = trace(&tree, &ray, any, &found);
}
