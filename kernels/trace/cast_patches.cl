// Work items, sorted by patch, are cast at their patches: a group takes a job, one patch and rays that
// reached it, and intersects the patch's hierarchy with each of them, or the patch itself where it is not
// built.
//
// GROUP work-items share a job; WIDE: 16 boxes are intersected at once.
#include "kernels/common/work_queue.h"
#include "kernels/trace/patch_instance.h"
#include "kernels/trace/traverse_patch.h"
#include "kernels/trace/unbuilt_patch.h"

// Unsigned keys in the order of t, negative ones included. UINT_MAX, which no number has, is no limit.
static inline uint key_of(float t) {
  const uint bits = as_uint(t);
  return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
}
static inline float t_of(uint key) { return as_float(key & 0x80000000u ? key & 0x7fffffffu : ~key); }

typedef struct CastScene {
  __global const PatchInstance* instances;
  __global const Patch* patches;
  __global const PatchParts* parts;
  __global const float* map;
  __global const PatchBlock* cache;
  __global const uint* links;
} CastScene;

// The tree of the job's patch, built or not.
static inline PatchTree job_tree(const CastScene* scene, const PatchJob* job) {
  const bool built = job->slot.at != PATCH_NOT_BUILT;
  PatchTree tree = built_tree(scene->cache + (built ? job->slot.at : 0), job->slot.level);
  if (!built) {
    tree.vertices = 0;
    tree.patch = scene->patches + job->patch;
    tree.map = scene->map;
    tree.edges = job->edges;
  }
  return tree;
}

// One ray. `found` has its limit; what is found goes there. Returns visits.
static inline uint cast_ray(const CastScene* scene, const PatchJob* job, PatchTree* tree, const Ray* world,
                            uint any, RayDetail detail, PatchFound* found) {
  __global const PatchInstance* instance = scene->instances + job->instance;
  __global const Patch* p = scene->patches + job->patch;
  const Ray ray = instance_ray(instance, world);
  PreparedRay q;
  if (!prepare_in(instance, &ray, &q) || (any && found->hit == FOUND_BEFORE)) return 0;
  const PatchRay pr = patch_ray(p, &q);
  float16 entry;
  const uint parts = intersect_planes16(scene->parts[job->patch].planes, &q, &pr, found->t, &entry);
  tree->wanted =
      wanted_level(p, detail_of(detail, ray_speed(&ray)), nearest_entry(parts, entry), job->slot.level);
  const uint visited = 1 + (job->slot.at != PATCH_NOT_BUILT
                                ? traverse_patch(tree, p, scene->links, &q, &pr, parts, entry, any, found)
                                : intersect_unbuilt(tree, &q, parts, entry, any, found));
  finish_found(tree, found);
  return visited;
}

// `places`: of the jobs' work items in sorted order. `limits`: a ray's nearest hit of this round, as
// key_of(), at first UINT_MAX. Each item's hit goes to item_hits, what it visited to item_steps where that is
// given. An item whose hit is not its ray's nearest may miss it: that depends on which item is cast first,
// the nearest hit does not.
__kernel void cast_patches(PatchCast cast, __global const PatchJob* jobs, __global uint* queue,
                           __global const PatchInstance* instances, __global const Patch* patches,
                           __global const PatchParts* parts, __global const float* map,
                           __global const PatchBlock* cache, __global const uint* links,
                           __global const uint* places, __global const WorkItem* items,
                           __global const Ray* rays, __global const Hit* hits, __global Hit* item_hits,
                           __global uint* item_steps, __global uint* limits) {
  const CastScene scene = {instances, patches, parts, map, cache, links};
  TAKE_FROM_QUEUE(queue, cast.jobs, {
    const PatchJob job = jobs[at];
    PatchTree tree = job_tree(&scene, &job);
    for (uint i = job.begin + (uint)get_local_id(0); i < job.end; i += GROUP) {
      const uint place = places[i], r = items[place].ray;
      const Ray world = rays[r];
      const Hit before = hits[r];
      PatchFound found;
      found.t = min(min(world.tmax, FLT_MAX), before.t);
      found.hit = before.leaf != RBVH_NO_LEAF ? FOUND_BEFORE : FOUND_NOTHING;
      const uint limit = atomic_or(limits + r, 0u);  // others write it meanwhile
      if (limit != UINT_MAX) {
        found.t = min(found.t, nextafter(t_of(limit), INFINITY));  // equally near hits count
        found.hit = FOUND_BEFORE;
      }
      const uint visited = cast_ray(&scene, &job, &tree, &world, cast.any, cast.detail, &found);
      item_hits[place] = make_hit(&found, instances + job.instance, job.patch, &world);
      if (item_steps) item_steps[place] = visited;
      if (found.hit > FOUND_BEFORE) atomic_min(limits + r, key_of(found.t));
    }
  });
}
