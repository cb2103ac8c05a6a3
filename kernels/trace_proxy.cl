// Ray casting proxies untessellated (Harada, "Rendering Vector Displacement Mapped Surfaces in a GPU Ray Tracer", GPU
// Pro 6, sections 1.4 and 1.5). Rays meet instances, then patches' boxes (cast_top). A patch whose hierarchy is there
// is met at once; for the others ray and patch become a pair, pairs are sorted by patch, hierarchies built
// (build_patches.cl), and groups take patch after patch from a queue and meet all its rays (cast_patches); a patch that
// few rays have come to is met without being built. What was found is then the rays' (take_hits).
//
// A round takes only the nearest few patches of each ray: most rays need no more, and what lies behind their hits is
// never built.
//
// GROUP work-items share a job; WIDE: boxes are met 16 at once; STACK: entries of the upper hierarchies' stack;
// MOST: pairs a ray and round; ATOMICS: nearest hits by 64-bit atomic minimum, else in order.
#include "patch_query.h"
#include "no_hit.h"
#include "object_ray.h"
#include "work_queue.h"

#ifdef ATOMICS
#pragma OPENCL EXTENSION cl_khr_int64_base_atomics : enable
#pragma OPENCL EXTENSION cl_khr_int64_extended_atomics : enable
#endif

static inline Ray instance_ray(__global const PatchInstance* instance, const Ray* ray) {
  const PatchInstance placed = *instance;
  return object_ray(placed.to_object, ray);
}

static inline float ray_speed(const Ray* ray) { return length(vload3(0, ray->direction)); }

// prepare() with the object's box, which is what rounding is measured by.
static inline bool prepare_in(__global const PatchInstance* instance, const Ray* ray, Query* q) {
  ExactScene box;
  for (uint axis = 0; axis < 3; ++axis) {
    box.lo[axis] = instance->lo[axis];
    box.hi[axis] = instance->hi[axis];
  }
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

static inline float nearest_entry(uint mask, float16 entry) {
  float t16[16], t = INFINITY;
  vstore16(entry, 0, t16);
  for (uint rest = mask; rest != 0; rest &= rest - 1) t = min(t, t16[lowest_bit(rest)]);
  return t;
}

// A patch that a ray enters at t and that is not built.
typedef struct Candidate {
  float t;
  uint pair;
} Candidate;

typedef struct Scene {
  __global const ExactNode* nodes;
  __global const PatchInstance* instances;
  __global const Patch* patches;
  __global const PatchParts* parts;
  __global const PatchSlot* slots;
  __global const PatchBlock* cache;
  __global const uint* links;
} Scene;

typedef struct Search {
  const Ray* world;
  uint any, at_once, most;
  RayDetail detail;
  PatchProgress after;  // patches entered before are done with
  float limit;          // nearest hit so far
  Candidate nearest[MOST + 1];  // one more than become pairs: whether the ray must go on depends on it
  uint count;
  uint visited;
  Hit hit;
} Search;

static inline float search_limit(const Search* s) {
  return s->count > s->most ? min(s->limit, s->nearest[s->most].t) : s->limit;
}

static inline void meet_patch(const Scene* scene, __global const PatchInstance* instance, uint patch, const Ray* ray,
                              const Query* q, Search* s) {
  __global const Patch* p = scene->patches + patch;
  const PatchRay r = patch_ray(p, q);
  float16 entry;
  const uint mask = meet_planes16(scene->parts[patch].planes, q, &r, search_limit(s), &entry);
  ++s->visited;
  if (mask == 0) return;
  const float t = nearest_entry(mask, entry);
  const uint pair = instance->first_pair + (patch - instance->first_patch);
  if (t < s->after.t || (t == s->after.t && pair <= s->after.pair)) return;
  const PatchSlot slot = scene->slots[patch];
  if (s->at_once && slot.at != PATCH_NOT_BUILT) {
    __global const PatchBlock* blocks = scene->cache + slot.at;
    PatchTree tree = built_tree(blocks, slot.level);
    tree.wanted = wanted_level(p, s->detail, t, ray_speed(ray), slot.level);
    PatchFound found;
    found.t = s->limit;
    found.hit = s->hit.leaf != RBVH_NO_LEAF ? FOUND_BEFORE : FOUND_NOTHING;
    s->visited += traverse_patch(&tree, p, scene->links, q, &r, mask, entry, s->any, &found);
    if (found.hit > FOUND_BEFORE) {
      finish_found(&tree, &found);
      s->limit = found.t;
      s->hit = make_hit(&found, instance, patch, s->world);
    }
    return;
  }
  if (s->count > s->most) {
    const Candidate last = s->nearest[s->most];
    if (t > last.t || (t == last.t && pair > last.pair)) return;
    --s->count;
  }
  uint at = s->count++;
  for (; at > 0 && (s->nearest[at - 1].t > t || (s->nearest[at - 1].t == t && s->nearest[at - 1].pair > pair)); --at)
    s->nearest[at] = s->nearest[at - 1];
  s->nearest[at].t = t;
  s->nearest[at].pair = pair;
}

// All patches of an instance, nearest first as far as boxes tell.
static inline void meet_instance(const Scene* scene, uint at, const Ray* world, Search* s) {
  __global const PatchInstance* instance = scene->instances + at;
  const Ray ray = instance_ray(instance, world);
  Query q;
  if (!prepare_in(instance, &ray, &q)) return;
  uint stack[STACK], depth = 0, current = instance->root;
  float stack_t[STACK];
  while (true) {
    uint next = 0;
    if (current & EXACT_LEAF_BIT) {
      meet_patch(scene, instance, instance->first_patch + (current & ~EXACT_LEAF_BIT), &ray, &q, s);
      if (s->any && s->hit.leaf != RBVH_NO_LEAF) return;
    } else {
      ++s->visited;
      __global const ExactNode* node = scene->nodes + current;
      float16 entry;
      const uint mask = meet_children(node, &q, search_limit(s), &entry);
      if (mask != 0) next = take_children(node->children, 0, mask, entry, stack, stack_t, &depth);
    }
    while (next == 0) {
      if (depth == 0) return;
      --depth;
      if (stack_t[depth] <= search_limit(s)) next = stack[depth];
    }
    current = next;
  }
}

// Ray active[i] goes on from `progress`, with `hits` as what was found before; pairs go behind each
// other, from pair_ranges[i].x on, .y of them.
__kernel void cast_top(__global const ExactNode* nodes, ExactScene top, __global const PatchInstance* instances,
                       __global const Patch* patches, __global const PatchParts* parts,
                       __global const PatchSlot* slots, __global const PatchBlock* cache, __global const uint* links,
                       __global const Ray* rays, __global const uint* active, uint count, uint any, uint at_once,
                       uint most, RayDetail detail, __global Hit* hits, __global PatchProgress* progress,
                       __global uint* pair_keys, __global uint* pair_rays, __global uint* pair_places,
                       __global uint2* pair_ranges, __global uint* pair_count, __global uint* steps) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  const uint r = active[i];
  const Ray ray = rays[r];
  const Scene scene = {nodes, instances, patches, parts, slots, cache, links};
  Search s;
  s.world = &ray;
  s.any = any;
  s.at_once = at_once;
  s.most = most;
  s.detail = detail;
  s.after = progress[r];
  s.hit = hits[r];
  s.limit = min(min(ray.tmax, FLT_MAX), s.hit.t);
  s.count = s.visited = 0;
  const uint leaf_before = s.hit.leaf;
  const float t_before = s.hit.t;
  Query q;
  if (any && leaf_before != RBVH_NO_LEAF) {
  } else if (top.root & EXACT_LEAF_BIT) {
    meet_instance(&scene, top.root & ~EXACT_LEAF_BIT, &ray, &s);
  } else if (prepare(&ray, &top, &q)) {
    uint stack[STACK], depth = 0, current = top.root;
    float stack_t[STACK];
    while (true) {
      uint next = 0;
      if (current & EXACT_LEAF_BIT) {
        meet_instance(&scene, current & ~EXACT_LEAF_BIT, &ray, &s);
        if (any && s.hit.leaf != RBVH_NO_LEAF) break;
      } else {
        ++s.visited;
        __global const ExactNode* node = nodes + current;
        float16 entry;
        const uint mask = meet_children(node, &q, search_limit(&s), &entry);
        if (mask != 0) next = take_children(node->children, 0, mask, entry, stack, stack_t, &depth);
      }
      while (next == 0 && depth > 0) {
        --depth;
        if (stack_t[depth] <= search_limit(&s)) next = stack[depth];
      }
      if (next == 0) break;
      current = next;
    }
  }
  if (any && s.hit.leaf != RBVH_NO_LEAF) s.count = 0;
  while (s.count > 0 && s.nearest[s.count - 1].t > s.limit) --s.count;  // behind what was found since
  if (s.hit.leaf != leaf_before || s.hit.t != t_before) hits[r] = s.hit;
  if (steps) steps[r] += s.visited;
  const uint pairs = min(s.count, most);
  uint first = 0;
  if (pairs > 0) first = atomic_add(pair_count, pairs);
  for (uint k = 0; k < pairs; ++k) {
    pair_keys[first + k] = s.nearest[k].pair;
    pair_rays[first + k] = r;
    pair_places[first + k] = first + k;
  }
  pair_ranges[i] = (uint2)(first, pairs);
  PatchProgress done = {INFINITY, 0xffffffffu, INFINITY};
  if (s.count > most) {
    done.t = s.nearest[most - 1].t;
    done.pair = s.nearest[most - 1].pair;
    done.next_t = s.nearest[most].t;
  }
  progress[r] = done;
}

#ifdef ATOMICS
// Larger for larger t, negative ones too.
static inline ulong nearest_key(float t, uint place) {
  const uint bits = as_uint(t);
  return (ulong)(bits & 0x80000000u ? ~bits : bits | 0x80000000u) << 32 | place;
}
static inline float key_t(ulong key) {
  const uint bits = (uint)(key >> 32);
  return as_float(bits & 0x80000000u ? bits & 0x7fffffffu : ~bits);
}
#define NEAREST __global ulong*
#else
#define NEAREST __global uint*
#endif

// What a job reads and writes: see cast_patches.
typedef struct Jobs {
  __global const PatchJob* jobs;
  __global const PatchInstance* instances;
  __global const Patch* patches;
  __global const PatchParts* parts;
  __global const float* map;
  __global const PatchBlock* cache;
  __global const uint* links;
  __global const uint* places;
  __global const uint* pair_rays;
  __global const Ray* rays;
  __global const Hit* hits;
  __global Hit* pair_hits;
  __global uint* pair_steps;
  NEAREST nearest;
  RayDetail detail;
  uint any;
} Jobs;

static inline void cast_job(const Jobs* j, uint at) {
  const PatchJob job = j->jobs[at];
  __global const PatchInstance* instance = j->instances + job.instance;
  __global const Patch* p = j->patches + job.patch;
  __global const PatchBlock* blocks = j->cache + (job.slot.at != PATCH_NOT_BUILT ? job.slot.at : 0);
  PatchTree tree = built_tree(blocks, job.slot.level);
  const bool built = job.slot.at != PATCH_NOT_BUILT;
  if (!built) {
    tree.vertices = 0;
    tree.patch = p;
    tree.map = j->map;
    tree.edges = job.edges;
  }
  for (uint i = job.begin + (uint)get_local_id(0); i < job.end; i += GROUP) {
    const uint place = j->places[i], r = j->pair_rays[place];
    const Ray world = j->rays[r], ray = instance_ray(instance, &world);
    const Hit before = j->hits[r];
    PatchFound found;
    found.t = min(min(ray.tmax, FLT_MAX), before.t);
    found.hit = before.leaf != RBVH_NO_LEAF ? FOUND_BEFORE : FOUND_NOTHING;
#ifdef ATOMICS
    const ulong best = j->nearest[r];
    if (best != ULONG_MAX) {
      found.t = min(found.t, nextafter(key_t(best), INFINITY));
      found.hit = FOUND_BEFORE;
    }
#endif
    uint visited = 0;
    Query q;
    if (prepare_in(instance, &ray, &q) && !(j->any && found.hit == FOUND_BEFORE)) {
      const PatchRay pr = patch_ray(p, &q);
      float16 entry;
      const uint mask = meet_planes16(j->parts[job.patch].planes, &q, &pr, found.t, &entry);
      tree.wanted = wanted_level(p, j->detail, nearest_entry(mask, entry), ray_speed(&ray), job.slot.level);
      visited = 1 + (built ? traverse_patch(&tree, p, j->links, &q, &pr, mask, entry, j->any, &found)
                           : meet_unbuilt(&tree, &q, mask, entry, j->any, &found));
      finish_found(&tree, &found);
    }
    j->pair_hits[place] = make_hit(&found, instance, job.patch, &world);
    if (j->pair_steps) j->pair_steps[place] = visited;
#ifdef ATOMICS
    if (found.hit > FOUND_BEFORE) atom_min(j->nearest + r, nearest_key(found.t, place));
#endif
  }
}

// Jobs' pairs in sorted order: `places` are where cast_top put them. What each found goes to pair_hits.
__kernel void cast_patches(__global const PatchJob* jobs, uint job_count, __global uint* queue,
                           __global const PatchInstance* instances, __global const Patch* patches,
                           __global const PatchParts* parts, __global const float* map,
                           __global const PatchBlock* cache, __global const uint* links, __global const uint* places,
                           __global const uint* pair_rays, __global const Ray* rays, uint any, RayDetail detail,
                           __global const Hit* hits, __global Hit* pair_hits, __global uint* pair_steps,
                           NEAREST nearest) {
  TAKE_FROM_QUEUE(queue, job_count, {
    const Jobs j = {jobs, instances, patches, parts, map, cache, links, places, pair_rays, rays, hits, pair_hits, pair_steps,
                    nearest, detail, any};
    cast_job(&j, at);
  });
}

__kernel void add_steps(__global const uint* active, uint count, __global const uint2* pair_ranges,
                        __global const uint* pair_steps, __global uint* steps) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  uint sum = 0;
  for (uint k = pair_ranges[i].x; k < pair_ranges[i].x + pair_ranges[i].y; ++k) sum += pair_steps[k];
  steps[active[i]] += sum;
}

// Each ray's nearest of its pairs' hits. Rays that come to another patch before what they hit go on.
__kernel void take_hits(__global const uint* active, uint count, uint any,
                        __global const uint2* pair_ranges, __global const Hit* pair_hits, NEAREST nearest,
                        __global const PatchProgress* progress, __global Hit* hits, __global uint* next_active,
                        __global uint* next_count) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  const uint r = active[i];
  Hit hit = hits[r];
#ifdef ATOMICS
  const ulong best = nearest[r];
  const uint from = best != ULONG_MAX ? (uint)best : 0;  // PoCL reads before it asks
  const Hit other = pair_hits[from];
  if (best != ULONG_MAX) {
    if (other.t < hit.t || (other.t == hit.t && other.leaf < hit.leaf)) hits[r] = hit = other;
  }
  nearest[r] = ULONG_MAX;
#else
  const uint2 range = pair_ranges[i];
  const float before = hit.t;
  const uint leaf_before = hit.leaf;
  for (uint k = range.x; k < range.x + range.y; ++k) {
    const Hit other = pair_hits[k];
    if (other.t < hit.t || (other.t == hit.t && other.leaf < hit.leaf)) hit = other;
  }
  if (hit.t != before || hit.leaf != leaf_before) hits[r] = hit;
#endif
  const float next_t = progress[r].next_t;
  const bool goes_on = next_t < INFINITY && hit.t >= next_t && !(any && hit.leaf != RBVH_NO_LEAF);
  if (goes_on) next_active[atomic_inc(next_count)] = r;
}

// Of `count` rays from `first` on every `stride`-th is active.
__kernel void start_rays(__global Hit* hits, __global PatchProgress* progress, __global uint* active, uint first,
                         uint count, uint stride, uint keep_hits, __global uint* steps) {
  const uint at = (uint)get_global_id(0), i = first + at;
  if (at >= count) return;
  active[at] = first + min(at * stride + stride / 2, count - 1);
  if (!keep_hits) {
    hits[i] = no_hit();
    if (steps) steps[i] = 0;
  }
  const PatchProgress start = {-INFINITY, 0u, -INFINITY};
  progress[i] = start;
}
