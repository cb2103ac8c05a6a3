// Instances of patch meshes: rays into their space, hits out of it.
#ifndef RBVH_PATCH_INSTANCE_H
#define RBVH_PATCH_INSTANCE_H
#include "kernels/common/no_hit.h"
#include "kernels/common/object_ray.h"
#include "kernels/trace/micro_quad.h"

static inline Ray instance_ray(__global const PatchInstance* instance, const Ray* ray) {
  const PatchInstance placed = *instance;
  return object_ray(placed.to_object, ray);
}

static inline float ray_speed(const Ray* ray) { return length(vload3(0, ray->direction)); }

static inline BvhRoot instance_box(__global const PatchInstance* instance) {
  BvhRoot box;
  for (uint axis = 0; axis < 3; ++axis) {
    box.lo[axis] = instance->lo[axis];
    box.hi[axis] = instance->hi[axis];
  }
  return box;
}

// prepare() with the object's box, by which rounding errors are bounded.
static inline bool prepare_in(__global const PatchInstance* instance, const Ray* ray, PreparedRay* q) {
  const BvhRoot box = instance_box(instance);
  return prepare(ray, &box, q);
}

static inline Hit make_hit(const PatchFound* found, __global const PatchInstance* instance, uint patch,
                           const Ray* world) {
  Hit hit = no_hit();
  if (found->hit > FOUND_BEFORE) {
    const PatchInstance placed = *instance;
    const float3 n = world_normal(placed.to_object, found->normal, world->direction);
    hit.t = found->t;
    hit.normal[0] = n.x;
    hit.normal[1] = n.y;
    hit.normal[2] = n.z;
    hit.u = found->u;
    hit.v = found->v;
    hit.leaf = instance->first_leaf + (patch - instance->first_patch);
    hit.flags = dot(n, vload3(0, world->direction)) > 0.0f ? RBVH_HIT_BACK_FACE : 0u;
  }
  return hit;
}

// Where the ray enters the nearest of a patch's parts in `mask`.
static inline float nearest_entry(uint mask, float16 entry) {
  const uint16 lanes = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  return -greatest(select((float16)(-INFINITY), -entry, as_int16((uint16)(mask) << (31 - lanes))));
}
#endif
