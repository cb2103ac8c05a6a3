// Sixteen incoherent rays search instances and patches interleaved: each reads memory that is far away, and
// while what one needs next is prefetched the others go on. Each visits what intersect_all() visits for it
// alone.
#ifndef RBVH_PATCH_INTERLEAVE_H
#define RBVH_PATCH_INTERLEAVE_H
#include "kernels/trace/patch_search.h"
#include "kernels/bvh/ray_lanes.h"

// One of the rays.
typedef struct Interleaved {
  uint current;  // what is next: a node, a leaf, or in a patch a VISIT()
  uint stage;    // AT_*
  uint depths[2], patch_depth;
  __global const PatchInstance* instance;
  PreparedRay prepared[2];  // among instances, among an instance's patches
  InPatch in;
  uint stacks[2][STACK], patch_stack[PATCH_STACK];
  float stacks_t[2][STACK], patch_stack_t[PATCH_STACK];
} Interleaved;

// Which of the hierarchies above the patches the ray is in.
#define AT_INSTANCES 0
#define AT_PATCHES 1

// What a ray waits for. Rays that wait for the same go on together, as their branches are predicted better.
#define WAITS_NOTHING 0
#define WAITS_PATCH 1
#define WAITS_BLOCK 2
#define WAITS_LEAVES 3
#define WAITS 4

// False where the ray can hit nothing in the instance.
static inline bool enter_instance(const PatchScene* scene, uint at, Interleaved* one, Search* s) {
  __global const PatchInstance* instance = one->instance = scene->instances + at;
  const Ray ray = instance_ray(instance, s->world);
  if (!prepare_in(instance, &ray, &one->prepared[AT_PATCHES])) return false;
  s->resolved = detail_of(s->detail, ray_speed(&ray));
  one->stage = AT_PATCHES;
  one->current = instance->root;
  one->depths[AT_PATCHES] = 0;
  return true;
}

// From `current` or, if that is done, from the stack to the next patch. Nodes are few and mostly in the
// cache: no need to wait for them. Returns what the ray waits for then.
static uint advance_to_patch(const PatchScene* scene, Interleaved* one, Search* s, bool is_done) {
  if (s->any && s->hit.leaf != RBVH_NO_LEAF) return WAITS_NOTHING;
  while (true) {
    const uint stage = one->stage;
    if (is_done) {
      one->current =
          pop_nearer(one->stacks[stage], one->stacks_t[stage], &one->depths[stage], search_limit(s));
      is_done = false;
      if (one->current == 0) {
        if (stage == AT_INSTANCES) return WAITS_NOTHING;
        one->stage = AT_INSTANCES;
        is_done = true;
        continue;
      }
    }
    if (!(one->current & BVH_LEAF_BIT)) {
      ++s->visited;
      one->current = open_node(scene->nodes + one->current, &one->prepared[stage], search_limit(s),
                               one->stacks[stage], one->stacks_t[stage], &one->depths[stage]);
      is_done = one->current == 0;
    } else if (stage == AT_INSTANCES) {
      is_done = !enter_instance(scene, one->current & ~BVH_LEAF_BIT, one, s);
    } else {
      const uint patch = one->instance->first_patch + (one->current & ~BVH_LEAF_BIT);
      ASK(scene->patches + patch, sizeof(Patch));
      ASK(scene->parts + patch, sizeof(PatchParts));
      ASK(scene->slots + patch, sizeof(PatchSlot));
      return WAITS_PATCH;
    }
  }
}

// In a patch or, where that is done, out of it and on.
static inline uint advance_in_patch(const PatchScene* scene, Interleaved* one, Search* s) {
  if (one->current != 0) return (one->current >> 24 & 15) == one->in.tree.level ? WAITS_LEAVES : WAITS_BLOCK;
  leave_patch(one->instance, &one->in, s);
  return advance_to_patch(scene, one, s, true);
}

static inline uint start_patch(const PatchScene* scene, Interleaved* one, Search* s) {
  const PreparedRay* q = &one->prepared[AT_PATCHES];
  uint parts;
  float16 entry;
  const uint patch = one->instance->first_patch + (one->current & ~BVH_LEAF_BIT);
  one->current = 0;
  if (!enter_patch(scene, one->instance, patch, q, s, &one->in, &parts, &entry))
    return advance_to_patch(scene, one, s, true);
  if (one->in.tree.level < 2) {
    s->visited += intersect_few_leaves(&one->in.tree, q, &one->in.found);
  } else {
    one->patch_depth = 0;
    one->current = first_visit(&one->in.tree, one->in.patch->loose, parts, entry, one->patch_stack,
                               one->patch_stack_t, &one->patch_depth);
  }
  return advance_in_patch(scene, one, s);
}

static inline uint visit_block(const PatchScene* scene, Interleaved* one, Search* s) {
  InPatch* in = &one->in;
  one->current =
      visit_patch(&in->tree, one->current, &one->prepared[AT_PATCHES], &in->ray, s->any, one->patch_stack,
                  one->patch_stack_t, &one->patch_depth, &in->found, &s->visited);
  return advance_in_patch(scene, one, s);
}

// From `root` on: of instance `at`, in whose space `rays` and `box` are; or of the hierarchy over all
// instances (RBVH_NO_LEAF).
static void intersect_interleaved(const PatchScene* scene, const BvhRoot* box, uint root, uint at,
                                  const RayLanes* rays, Search* s) {
  Interleaved all[PACKET];
  PreparedLanes prepared;
  prepare_lanes(rays, box, &prepared);
  uint waiting[WAITS] = {0, 0, 0, 0};
  for (uint lanes = prepared.valid; lanes != 0; lanes &= lanes - 1) {
    const uint i = lowest_bit(lanes);
    if (s[i].any && s[i].leaf_before != RBVH_NO_LEAF) continue;
    Interleaved* one = all + i;
    one->stage = at == RBVH_NO_LEAF ? AT_INSTANCES : AT_PATCHES;
    one->depths[AT_INSTANCES] = one->depths[AT_PATCHES] = 0;
    one->current = root;
    PreparedRay* q = &one->prepared[one->stage];
    prepared_ray_of(&prepared, i, q);
    if (at != RBVH_NO_LEAF) {
      one->instance = scene->instances + at;
      s[i].resolved = detail_of(s[i].detail, length(vload3(0, q->direction)));
    }
    waiting[advance_to_patch(scene, one, s + i, false)] |= 1u << i;
  }
  while (true) {
    uint now = waiting[WAITS_PATCH];
    const uint blocks = waiting[WAITS_BLOCK], leaves = waiting[WAITS_LEAVES];
    if ((now | blocks | leaves) == 0) return;
    waiting[WAITS_PATCH] = waiting[WAITS_BLOCK] = waiting[WAITS_LEAVES] = 0;
    for (; now != 0; now &= now - 1) {
      const uint i = lowest_bit(now);
      waiting[start_patch(scene, all + i, s + i)] |= 1u << i;
    }
    for (now = blocks; now != 0; now &= now - 1) {
      const uint i = lowest_bit(now);
      waiting[visit_block(scene, all + i, s + i)] |= 1u << i;
    }
    for (now = leaves; now != 0; now &= now - 1) {
      const uint i = lowest_bit(now);
      waiting[visit_block(scene, all + i, s + i)] |= 1u << i;
    }
  }
}

// All instances.
static inline void intersect_all_interleaved(const PatchScene* scene, const BvhRoot* top,
                                             const RayLanes* rays, Search* s) {
  if (!(top->root & BVH_LEAF_BIT)) {
    intersect_interleaved(scene, top, top->root, RBVH_NO_LEAF, rays, s);
    return;
  }
  const uint at = top->root & ~BVH_LEAF_BIT;
  const PatchInstance placed = scene->instances[at];
  const BvhRoot box = instance_box(scene->instances + at);
  RayLanes placed_rays;
  place_lanes(placed.to_object, rays, &placed_rays);
  intersect_interleaved(scene, &box, placed.root, at, &placed_rays, s);
}
#endif
