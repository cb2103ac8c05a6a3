// The kernels of an exact traversal, the same for all. The file that includes this has defined
//   NODE, PRIMITIVE                                   what its tree is made of,
//   uint2 traverse(tree, query, any, found)           the traversal; returns nodes and primitives visited,
//   float3 unit_normal(primitives, at)
// and has included exact_tree.h before them.
#include "kernels/common/camera_rays.h"
#include "kernels/common/no_hit.h"

// Nearest hit, or any if `any` is set. Returns nodes and primitives visited.
static inline uint2 trace(const Tree* tree, const Ray* ray, uint any, Found* found) {
  *found = (Found){min(ray->tmax, FLT_MAX), 0.0f, 0.0f, RBVH_NO_LEAF, 0u};
  Query q;
  if (!prepare(ray, tree->scene, &q)) return (uint2)(0u);
  return traverse(tree, &q, any, found);
}

static inline Hit make_hit(const Found* found, __global const PRIMITIVE* primitives, const Ray* ray) {
  Hit hit = no_hit();
  if (found->id != RBVH_NO_LEAF) {
    const float3 n = unit_normal(primitives, found->at);
    hit.t = found->t;
    hit.normal[0] = n.x;
    hit.normal[1] = n.y;
    hit.normal[2] = n.z;
    hit.u = found->u;
    hit.v = found->v;
    hit.leaf = found->id;
    const float along = n.x * ray->direction[0] + n.y * ray->direction[1] + n.z * ray->direction[2];
    hit.flags = RBVH_HIT_TRIANGLE_LEAF | (along > 0.0f ? RBVH_HIT_BACK_FACE : 0u);
  }
  return hit;
}

__kernel void trace_rays(__global const NODE* nodes, __global const PRIMITIVE* primitives,
                         __global const uint* references, BvhRoot scene, __global const Ray* rays, uint count,
                         uint any, __global Hit* hits, __global uint* steps) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  const Tree tree = {nodes, primitives, references, &scene};
  const Ray ray = rays[i];
  Found found;
  const uint2 visited = trace(&tree, &ray, any, &found);
  hits[i] = make_hit(&found, primitives, &ray);
  if (steps) steps[i] = visited.x + visited.y;
}

__kernel void trace_camera(__global const NODE* nodes, __global const PRIMITIVE* primitives,
                           __global const uint* references, BvhRoot scene, CameraRays camera,
                           __global Hit* hits, __global uint* steps) {
  const uint2 pixel = camera_pixel(camera.width, (uint)get_global_id(0));
  if (pixel.x >= camera.width || pixel.y >= camera.height) return;
  const Tree tree = {nodes, primitives, references, &scene};
  const Ray ray = camera_ray(&camera, pixel.x, pixel.y);
  Found found;
  const uint2 visited = trace(&tree, &ray, 0, &found);
  const uint i = pixel.y * camera.width + pixel.x;
  hits[i] = make_hit(&found, primitives, &ray);
  if (steps) steps[i] = visited.x + visited.y;
}

// Nodes and primitives visited apart, for benchmarks.
__kernel void trace_visits(__global const NODE* nodes, __global const PRIMITIVE* primitives,
                           __global const uint* references, BvhRoot scene, __global const Ray* rays,
                           uint count, uint any, __global uint2* visits) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  const Tree tree = {nodes, primitives, references, &scene};
  const Ray ray = rays[i];
  Found found;
  visits[i] = trace(&tree, &ray, any, &found);
}
