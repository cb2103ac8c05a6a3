// A ray's search among instances and their patches, and what it does at a patch: intersect it, or make a work
// item of it. Shared by the searches of one ray, of sixteen interleaved rays and of packets.
//
// A round takes only the nearest few patches of each ray that are not built: most rays need no more, and the
// hierarchies behind their hits are never built.
//
// STACK: entries of the upper hierarchies' stack; MOST: work items a ray and round.
#ifndef RBVH_PATCH_SEARCH_H
#define RBVH_PATCH_SEARCH_H
#include "kernels/trace/patch_instance.h"
#include "kernels/trace/ray_queue.h"
#include "kernels/trace/traverse_patch.h"

typedef struct PatchScene {
  __global const WideNode* nodes;
  __global const PatchInstance* instances;
  __global const Patch* patches;
  __global const PatchParts* parts;
  __global const PatchSlot* slots;
  __global const PatchBlock* cache;
  __global const uint* links;
} PatchScene;

typedef struct Search {
  const Ray* world;
  uint any, at_once;
  RayDetail detail;
  RayDetail resolved;  // the same in the space of the current instance
  float limit;         // nearest hit so far
  NearestFew few;      // patches that become work items
  uint visited;
  Hit hit;
  float t_before;  // the hit the search started from
  uint leaf_before;
} Search;

static inline float search_limit(const Search* s) { return few_limit(&s->few, s->limit); }

// A ray in a patch that is built.
typedef struct InPatch {
  __global const Patch* patch;
  uint number;
  PatchTree tree;
  PatchRay ray;
  PatchFound found;
} InPatch;

// Whether the ray traverses the patch's hierarchy now; `parts`, `entry`: the parts it intersects, and where.
static inline bool enter_patch(const PatchScene* scene, __global const PatchInstance* instance, uint patch,
                               const PreparedRay* q, Search* s, InPatch* in, uint* parts, float16* entry) {
  __global const Patch* p = scene->patches + patch;
  in->ray = patch_ray(p, q);
  *parts = intersect_planes16(scene->parts[patch].planes, q, &in->ray, search_limit(s), entry);
  ++s->visited;
  if (*parts == 0) return false;
  const float t = nearest_entry(*parts, *entry);
  const uint target = instance->first_target + (patch - instance->first_patch);
  if (is_done_with(&s->few, t, target)) return false;
  const PatchSlot slot = scene->slots[patch];
  if (!s->at_once || slot.at == PATCH_NOT_BUILT) {
    add_candidate(&s->few, t, target);
    return false;
  }
  in->patch = p;
  in->number = patch;
  in->tree = built_tree(scene->cache + slot.at, slot.level);
  in->tree.wanted = wanted_level(p, s->resolved, t, slot.level);
  in->found.t = s->limit;
  in->found.hit = s->hit.leaf != RBVH_NO_LEAF ? FOUND_BEFORE : FOUND_NOTHING;
  return true;
}

static inline void leave_patch(__global const PatchInstance* instance, InPatch* in, Search* s) {
  if (in->found.hit <= FOUND_BEFORE) return;
  finish_found(&in->tree, &in->found);
  s->limit = in->found.t;
  s->hit = make_hit(&in->found, instance, in->number, s->world);
}

static inline void intersect_patch(const PatchScene* scene, __global const PatchInstance* instance,
                                   uint patch, const PreparedRay* q, Search* s) {
  InPatch in;
  uint parts;
  float16 entry;
  if (!enter_patch(scene, instance, patch, q, s, &in, &parts, &entry)) return;
  s->visited += traverse_patch(&in.tree, in.patch, scene->links, q, &in.ray, parts, entry, s->any, &in.found);
  leave_patch(instance, &in, s);
}

static inline void begin_search(Search* s, const Ray* ray, const PatchSearch* search) {
  s->world = ray;
  s->any = search->any;
  s->at_once = search->at_once;
  s->detail = search->detail;
  s->few.after = no_progress();
  s->few.most = search->most_items;
  s->few.count = 0;
  s->hit = no_hit();
  s->limit = min(ray->tmax, FLT_MAX);
  s->visited = 0;
  s->leaf_before = RBVH_NO_LEAF;
  s->t_before = INFINITY;
}

// Starting from a hit.
static inline void begin_after(Search* s, Hit before) {
  s->hit = before;
  s->limit = min(s->limit, before.t);
  s->leaf_before = before.leaf;
  s->t_before = before.t;
}

// Stores what ray r found: its hit, its work items, how far it has come. `fresh`: there is no hit of it yet.
static inline void end_search(Search* s, uint r, bool fresh, const RayQueue* queue, __global Hit* hits,
                              __global RayProgress* progress, __global uint* steps) {
  if (s->any && s->hit.leaf != RBVH_NO_LEAF) s->few.count = 0;
  const uint items = finish_candidates(&s->few, s->limit);
  if (fresh || s->hit.leaf != s->leaf_before || s->hit.t != s->t_before) hits[r] = s->hit;
  if (steps) steps[r] = s->visited + (fresh ? 0u : steps[r]);
  if (items == 0) return;
  const uint first = reserve_items(queue, r, items);
  for (uint k = 0; k < items; ++k) put_item(queue, first + k, s->few.nearest[k].id, r, s->few.nearest[k].id);
  progress[r] = progress_of(&s->few);
}

// The searches' buffers, in the order in which pipeline/trace/trace_patch.cpp passes them. `active`: rays
// that go on from `progress`, with `hits` found before; null: those of search.range begin. `steps`: may be
// null.
#define SEARCH_BUFFERS                                                                                     \
  __global const WideNode *nodes, __global const PatchInstance *instances, __global const Patch *patches,  \
      __global const PatchParts *parts, __global const PatchSlot *slots, __global const PatchBlock *cache, \
      __global const uint *links, __global const Ray *rays, __global const uint *active,                   \
      __global uint *keys, __global uint *places, __global WorkItem *items, __global RayItems *listed,     \
      __global uint *counts, __global RayProgress *progress, __global Hit *hits, __global uint *steps
#define SEARCH_SCENE \
  { nodes, instances, patches, parts, slots, cache, links }
#define SEARCH_QUEUE \
  { keys, places, items, listed, counts }
#endif
