// Ray casting proxies untessellated (Harada, "Rendering Vector Displacement Mapped Surfaces in a GPU Ray
// Tracer", GPU Pro 6, sections 1.4 and 1.5). Rays meet instances, then patches' boxes (cast_top). A patch
// whose hierarchy is there is met at once; for the others ray and patch become a pair, pairs are sorted by
// patch, hierarchies built (build_patches.cl), and groups take patch after patch from a queue and meet all
// its rays (cast_patches); a patch that few rays have come to is met without being built. What was found is
// then the rays' (take_hits).
//
// A round takes only the nearest few patches of each ray: most rays need no more, and what lies behind their
// hits is never built.
//
// GROUP work-items share a job; WIDE: boxes are met 16 at once; STACK: entries of the upper hierarchies'
// stack; MOST: pairs a ray and round; ATOMICS: nearest hits by 64-bit atomic minimum, else in order.
#include "kernels/trace/patch_query.h"
#ifdef WIDE
#include "kernels/trace/patch_packet.h"
#endif
#include "kernels/trace/nearest_few.h"
#include "kernels/common/no_hit.h"
#include "kernels/common/object_ray.h"
#include "kernels/common/work_queue.h"

#ifdef ATOMICS
#pragma OPENCL EXTENSION cl_khr_int64_base_atomics : enable
#pragma OPENCL EXTENSION cl_khr_int64_extended_atomics : enable
#endif

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

// prepare() with the object's box, which is what rounding is measured by.
static inline bool prepare_in(__global const PatchInstance* instance, const Ray* ray, Query* q) {
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

static inline float nearest_entry(uint mask, float16 entry) {
  const uint16 lanes = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  return -greatest(select((float16)(-INFINITY), -entry, as_int16((uint16)(mask) << (31 - lanes))));
}

typedef struct Scene {
  __global const WideNode* nodes;
  __global const PatchInstance* instances;
  __global const Patch* patches;
  __global const PatchParts* parts;
  __global const PatchSlot* slots;
  __global const PatchBlock* cache;
  __global const uint* links;
} Scene;

typedef struct Search {
  const Ray* world;
  uint any, at_once;
  RayDetail detail;
  RayDetail resolved;  // the same in the instance that is being met
  float limit;         // nearest hit so far
  NearestFew few;      // patches that are not built, as pairs
  uint visited;
  Hit hit;
  float t_before;  // of what was found before the search
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

// Whether the ray is to go through the patch's hierarchy now; `parts`, `entry`: of it.
static inline bool enter_patch(const Scene* scene, __global const PatchInstance* instance, uint patch,
                               const Query* q, Search* s, InPatch* in, uint* parts, float16* entry) {
  __global const Patch* p = scene->patches + patch;
  in->ray = patch_ray(p, q);
  *parts = intersect_planes16(scene->parts[patch].planes, q, &in->ray, search_limit(s), entry);
  ++s->visited;
  if (*parts == 0) return false;
  const float t = nearest_entry(*parts, *entry);
  const uint pair = instance->first_pair + (patch - instance->first_patch);
  if (is_done_with(&s->few, t, pair)) return false;
  const PatchSlot slot = scene->slots[patch];
  if (!s->at_once || slot.at == PATCH_NOT_BUILT) {
    add_candidate(&s->few, t, pair);
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

static inline void intersect_patch(const Scene* scene, __global const PatchInstance* instance, uint patch,
                                   const Query* q, Search* s) {
  InPatch in;
  uint parts;
  float16 entry;
  if (!enter_patch(scene, instance, patch, q, s, &in, &parts, &entry)) return;
  s->visited += traverse_patch(&in.tree, in.patch, scene->links, q, &in.ray, parts, entry, s->any, &in.found);
  leave_patch(instance, &in, s);
}

// All patches of an instance, nearest first as far as boxes tell.
static inline void intersect_instance(const Scene* scene, uint at, const Ray* world, Search* s) {
  __global const PatchInstance* instance = scene->instances + at;
  const Ray ray = instance_ray(instance, world);
  Query q;
  if (!prepare_in(instance, &ray, &q)) return;
  s->resolved = detail_of(s->detail, ray_speed(&ray));
  uint stack[STACK], depth = 0, current = instance->root;
  float stack_t[STACK];
  while (true) {
    uint next = 0;
    if (current & BVH_LEAF_BIT) {
      intersect_patch(scene, instance, instance->first_patch + (current & ~BVH_LEAF_BIT), &q, s);
      if (s->any && s->hit.leaf != RBVH_NO_LEAF) return;
    } else {
      ++s->visited;
      next = open_node(scene->nodes + current, &q, search_limit(s), stack, stack_t, &depth);
    }
    if (next == 0) next = pop_nearer(stack, stack_t, &depth, search_limit(s));
    if (next == 0) return;
    current = next;
  }
}

// One ray and everything.
static inline void intersect_all(const Scene* scene, const BvhRoot* top, const Ray* ray, Search* s) {
  if (s->any && s->leaf_before != RBVH_NO_LEAF) return;
  if (top->root & BVH_LEAF_BIT) {
    intersect_instance(scene, top->root & ~BVH_LEAF_BIT, ray, s);
    return;
  }
  Query q;
  if (!prepare(ray, top, &q)) return;
  uint stack[STACK], depth = 0, current = top->root;
  float stack_t[STACK];
  while (true) {
    uint next = 0;
    if (current & BVH_LEAF_BIT) {
      intersect_instance(scene, current & ~BVH_LEAF_BIT, ray, s);
      if (s->any && s->hit.leaf != RBVH_NO_LEAF) return;
    } else {
      ++s->visited;
      next = open_node(scene->nodes + current, &q, search_limit(s), stack, stack_t, &depth);
    }
    if (next == 0) next = pop_nearer(stack, stack_t, &depth, search_limit(s));
    if (next == 0) return;
    current = next;
  }
}

static inline void begin_search(Search* s, const Ray* ray, uint any, uint at_once, uint most,
                                RayDetail detail) {
  s->world = ray;
  s->any = any;
  s->at_once = at_once;
  s->detail = detail;
  s->few.after = no_progress();
  s->few.most = most;
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

// The at-th of `count` pixels when squares of 4 x 4 are visited row by row; those at the rim are what is
// left.
static inline uint square_pixel(uint at, uint count, uint row) {
  const uint band = at / (4 * row), in_band = at - 4 * row * band;
  const uint height = min(4u, (count - 4 * row * band) / row);
  if (in_band >= row * height) return at;  // in a row that is cut off
  const uint left = 4 * (in_band / (4 * height)), width = min(4u, row - left),
             in_square = in_band - left * height;
  return (4 * band + in_square / width) * row + left + in_square % width;
}

// Where pairs go: behind each other. Rays with pairs are listed; those of the list's i-th are from
// ranges[i].x on, ranges[i].y of them. counts: of pairs, of such rays, and of the rays that go on from the
// round before.
typedef struct Pairs {
  __global uint *keys, *rays, *places, *counts, *listed;
  __global uint2* ranges;
} Pairs;

// What ray r has come to.
static inline void end_search(Search* s, uint r, bool fresh, const Pairs* to, __global Hit* hits,
                              __global RayProgress* progress, __global uint* steps) {
  if (s->any && s->hit.leaf != RBVH_NO_LEAF) s->few.count = 0;
  const uint pairs = finish_candidates(&s->few, s->limit);
  if (fresh || s->hit.leaf != s->leaf_before || s->hit.t != s->t_before) hits[r] = s->hit;
  if (steps) steps[r] = s->visited + (fresh ? 0u : steps[r]);
  if (pairs == 0) return;
  const uint first = atomic_add(to->counts, pairs), i = atomic_inc(to->counts + 1);
  for (uint k = 0; k < pairs; ++k) {
    to->keys[first + k] = s->few.nearest[k].id;
    to->rays[first + k] = r;
    to->places[first + k] = first + k;
  }
  to->listed[i] = r;
  to->ranges[i] = (uint2)(first, pairs);
  progress[r] = progress_of(&s->few);
}

// The list's i-th ray.
static inline uint ray_number(__global const uint* active, RayRange range, uint i) {
  if (active) return active[i];
  if (range.row > 0) return range.first + square_pixel(i, range.count, range.row);
  return range.first + min(i * range.stride + range.stride / 2, range.count - 1);
}

// The first counts[2] rays of `active` go on from `progress`, with `hits` as what was found before; without
// `active` those of `range` begin. There are at most most_rays.
#define CAST_TOP_ARGUMENTS                                                                              \
  __global const WideNode *nodes, BvhRoot top, __global const PatchInstance *instances,                 \
      __global const Patch *patches, __global const PatchParts *parts, __global const PatchSlot *slots, \
      __global const PatchBlock *cache, __global const uint *links, __global const Ray *rays,           \
      __global const uint *active, RayRange range, uint most_rays, uint any, uint at_once, uint most,   \
      RayDetail detail, __global Hit *hits, __global RayProgress *progress, __global uint *pair_keys,   \
      __global uint *pair_rays, __global uint *pair_places, __global uint2 *pair_ranges,                \
      __global uint *listed, __global uint *counts, __global uint *steps

__kernel void cast_top(CAST_TOP_ARGUMENTS) {
  const uint i = (uint)get_global_id(0), count = active ? counts[2] : most_rays;
  if (i >= count) return;
  const uint r = ray_number(active, range, i);
  const Ray ray = rays[r];
  const Scene scene = {nodes, instances, patches, parts, slots, cache, links};
  const Pairs pairs = {pair_keys, pair_rays, pair_places, counts, listed, pair_ranges};
  const bool is_fresh = !active && !range.keep_hits;
  Search s;
  begin_search(&s, &ray, any, at_once, most, detail);
  if (active) s.few.after = progress[r];
  if (!is_fresh) begin_after(&s, hits[r]);
  intersect_all(&scene, &top, &ray, &s);
  end_search(&s, r, is_fresh, &pairs, hits, progress, steps);
}

#ifdef WIDE
// Rays that do not stay together read what is far away, each alone: sixteen take turns, and while what one
// reads next is on its way the others go on. Each goes the way of intersect_all().
typedef struct Turn {
  uint current;  // what is next: a node, a leaf, or in a patch what VISIT() makes
  uint stage;    // AT_*
  uint depths[2], patch_depth;
  __global const PatchInstance* instance;
  Query queries[2];  // among instances, among an instance's patches
  InPatch in;
  uint stacks[2][STACK], patch_stack[PATCH_STACK];
  float stacks_t[2][STACK], patch_stack_t[PATCH_STACK];
} Turn;

// Above the patches: which of the two hierarchies it is in.
#define AT_INSTANCES 0
#define AT_PATCHES 1

// What it waits for. Those that wait for the same go on together, which the processor foresees better.
#define WAITS_NOTHING 0
#define WAITS_PATCH 1
#define WAITS_BLOCK 2
#define WAITS_LEAVES 3
#define WAITS 4

// False where the ray can hit nothing there.
static inline bool enter_instance(const Scene* scene, uint at, Turn* turn, Search* s) {
  __global const PatchInstance* instance = turn->instance = scene->instances + at;
  const Ray ray = instance_ray(instance, s->world);
  if (!prepare_in(instance, &ray, &turn->queries[AT_PATCHES])) return false;
  s->resolved = detail_of(s->detail, ray_speed(&ray));
  turn->stage = AT_PATCHES;
  turn->current = instance->root;
  turn->depths[AT_PATCHES] = 0;
  return true;
}

// From `current` or, if that is done with, from what was put off to the next patch: from node to node, which
// are near.
static uint go_to_patch(const Scene* scene, Turn* turn, Search* s, bool is_done) {
  if (s->any && s->hit.leaf != RBVH_NO_LEAF) return WAITS_NOTHING;
  while (true) {
    const uint stage = turn->stage;
    if (is_done) {
      turn->current =
          pop_nearer(turn->stacks[stage], turn->stacks_t[stage], &turn->depths[stage], search_limit(s));
      is_done = false;
      if (turn->current == 0) {
        if (stage == AT_INSTANCES) return WAITS_NOTHING;
        turn->stage = AT_INSTANCES;
        is_done = true;
        continue;
      }
    }
    if (!(turn->current & BVH_LEAF_BIT)) {
      ++s->visited;
      turn->current = open_node(scene->nodes + turn->current, &turn->queries[stage], search_limit(s),
                                turn->stacks[stage], turn->stacks_t[stage], &turn->depths[stage]);
      is_done = turn->current == 0;
    } else if (stage == AT_INSTANCES) {
      is_done = !enter_instance(scene, turn->current & ~BVH_LEAF_BIT, turn, s);
    } else {
      const uint patch = turn->instance->first_patch + (turn->current & ~BVH_LEAF_BIT);
      ASK(scene->patches + patch, sizeof(Patch));
      ASK(scene->parts + patch, sizeof(PatchParts));
      ASK(scene->slots + patch, sizeof(PatchSlot));
      return WAITS_PATCH;
    }
  }
}

// In a patch or, where that is done with, out of it and on.
static inline uint go_to_block(const Scene* scene, Turn* turn, Search* s) {
  if (turn->current != 0)
    return (turn->current >> 24 & 15) == turn->in.tree.level ? WAITS_LEAVES : WAITS_BLOCK;
  leave_patch(turn->instance, &turn->in, s);
  return go_to_patch(scene, turn, s, true);
}

static inline uint take_patch(const Scene* scene, Turn* turn, Search* s) {
  const Query* q = &turn->queries[AT_PATCHES];
  uint parts;
  float16 entry;
  const uint patch = turn->instance->first_patch + (turn->current & ~BVH_LEAF_BIT);
  turn->current = 0;
  if (!enter_patch(scene, turn->instance, patch, q, s, &turn->in, &parts, &entry))
    return go_to_patch(scene, turn, s, true);
  if (turn->in.tree.level < 2) {
    s->visited += intersect_few_leaves(&turn->in.tree, q, &turn->in.found);
  } else {
    turn->patch_depth = 0;
    turn->current = first_visit(&turn->in.tree, turn->in.patch->loose, parts, entry, turn->patch_stack,
                                turn->patch_stack_t, &turn->patch_depth);
  }
  return go_to_block(scene, turn, s);
}

static inline uint take_block(const Scene* scene, Turn* turn, Search* s) {
  InPatch* in = &turn->in;
  turn->current =
      visit_patch(&in->tree, turn->current, &turn->queries[AT_PATCHES], &in->ray, s->any, turn->patch_stack,
                  turn->patch_stack_t, &turn->patch_depth, &in->found, &s->visited);
  return go_to_block(scene, turn, s);
}

// Sixteen rays from `root` on: of instance `at`, whose space `rays` and `box` are in, or of everything
// (RBVH_NO_LEAF).
static void intersect_in_turn(const Scene* scene, const BvhRoot* box, uint root, uint at,
                              const RayLanes* rays, Search* s) {
  Turn turns[PACKET];
  QueryLanes queries;
  prepare_lanes(rays, box, &queries);
  uint waiting[WAITS] = {0, 0, 0, 0};
  for (uint lanes = queries.valid; lanes != 0; lanes &= lanes - 1) {
    const uint i = lowest_bit(lanes);
    if (s[i].any && s[i].leaf_before != RBVH_NO_LEAF) continue;
    Turn* turn = turns + i;
    turn->stage = at == RBVH_NO_LEAF ? AT_INSTANCES : AT_PATCHES;
    turn->depths[AT_INSTANCES] = turn->depths[AT_PATCHES] = 0;
    turn->current = root;
    Query* q = &turn->queries[turn->stage];
    query_of(&queries, i, q);
    if (at != RBVH_NO_LEAF) {
      turn->instance = scene->instances + at;
      s[i].resolved = detail_of(s[i].detail, length(vload3(0, q->direction)));
    }
    waiting[go_to_patch(scene, turn, s + i, false)] |= 1u << i;
  }
  while (true) {
    uint now = waiting[WAITS_PATCH];
    const uint blocks = waiting[WAITS_BLOCK], leaves = waiting[WAITS_LEAVES];
    if ((now | blocks | leaves) == 0) return;
    waiting[WAITS_PATCH] = waiting[WAITS_BLOCK] = waiting[WAITS_LEAVES] = 0;
    for (; now != 0; now &= now - 1) {
      const uint i = lowest_bit(now);
      waiting[take_patch(scene, turns + i, s + i)] |= 1u << i;
    }
    for (now = blocks; now != 0; now &= now - 1) {
      const uint i = lowest_bit(now);
      waiting[take_block(scene, turns + i, s + i)] |= 1u << i;
    }
    for (now = leaves; now != 0; now &= now - 1) {
      const uint i = lowest_bit(now);
      waiting[take_block(scene, turns + i, s + i)] |= 1u << i;
    }
  }
}

// What ray i has left of its way; a ray that can hit nothing has none.
static inline void load_limits(const Packet* p, const Search* s, float* limits) {
  for (uint i = 0; i < PACKET; ++i) limits[i] = p->lanes >> i & 1 ? search_limit(s + i) : -INFINITY;
}

static inline void intersect_patch_packet(const Scene* scene, __global const PatchInstance* instance,
                                          uint patch, Packet* p, Search* s, float* limits, uint* visited) {
  __global const Patch* patch_at = scene->patches + patch;
  PatchPacket r;
  patch_packet(patch_at, p, &r);
  float16 entry, left;
  const uint mask =
      intersect_planes_packet(scene->parts[patch].planes, p, &r, greatest(vload16(0, limits)), &entry, &left);
  ++*visited;
  if (mask == 0) return;
  uint lanes = intersect_patch_box(p, &r, limits);
  const PatchSlot slot = scene->slots[patch];
  if (s->at_once && slot.at != PATCH_NOT_BUILT && slot.level >= 2 && popcount(lanes) >= PACKET_LEAST &&
      wanted_level(patch_at, detail_of(s->detail, p->speed), greatest(left), slot.level) == slot.level) {
    const PatchTree tree = built_tree(scene->cache + slot.at, slot.level);
    PatchFound found[PACKET];
    float found_limits[PACKET];
    for (uint i = 0; i < PACKET; ++i) {
      const bool used = p->lanes >> i & 1;
      found[i].t = found_limits[i] = used ? s[i].limit : -INFINITY;
      found[i].hit = used && s[i].hit.leaf != RBVH_NO_LEAF ? FOUND_BEFORE : FOUND_NOTHING;
    }
    *visited += traverse_patch_packet(&tree, patch_at, p, &r, mask, entry, found_limits, found);
    for (uint i = 0; i < PACKET; ++i) {
      if (found[i].hit <= FOUND_BEFORE) continue;
      finish_found(&tree, found + i);
      s[i].limit = found[i].t;
      s[i].hit = make_hit(found + i, instance, patch, s[i].world);
    }
  } else {
    for (; lanes != 0; lanes &= lanes - 1) {
      const uint i = lowest_bit(lanes);
      if (!(p->whole >> i & 1)) {
        const Ray ray = instance_ray(instance, s[i].world);
        prepare_in(instance, &ray, p->rays + i);
        s[i].resolved = detail_of(s[i].detail, ray_speed(&ray));
        p->whole |= 1u << i;
      }
      intersect_patch(scene, instance, patch, p->rays + i, s + i);
    }
  }
  load_limits(p, s, limits);
}

static inline void intersect_instance_packet(const Scene* scene, uint at, const RayLanes* world, Search* s,
                                             uint* visited) {
  __global const PatchInstance* instance = scene->instances + at;
  const PatchInstance placed = *instance;
  RayLanes rays;
  place_lanes(placed.to_object, world, &rays);
  const BvhRoot box = instance_box(instance);
  float from[PACKET];
  for (uint i = 0; i < PACKET; ++i) from[i] = world->used >> i & 1 ? search_limit(s + i) : -INFINITY;
  rays.used = intersect_box_lanes(&rays, &box, vload16(0, from));
  Packet p;
  p.lanes = rays.used;
  if (popcount(rays.used) < PACKET_LEAST || !prepare_packet(&rays, &box, &p)) {
    intersect_in_turn(scene, &box, instance->root, at, &rays, s);
    return;
  }
  float limits[PACKET];
  load_limits(&p, s, limits);
  uint stack[STACK], depth = 0, current = instance->root;
  float stack_t[STACK];
  while (true) {
    uint next = 0;
    if (current & BVH_LEAF_BIT) {
      intersect_patch_packet(scene, instance, instance->first_patch + (current & ~BVH_LEAF_BIT), &p, s,
                             limits, visited);
    } else {
      ++*visited;
      next = open_node_packet(scene->nodes + current, &p.bounds, greatest(vload16(0, limits)), stack, stack_t,
                              &depth);
    }
    const float limit = greatest(vload16(0, limits));
    if (next == 0) next = pop_nearer(stack, stack_t, &depth, limit);
    if (next == 0) return;
    current = next;
  }
}

// As intersect_all(), in turn.
static inline void intersect_all_in_turn(const Scene* scene, const BvhRoot* top, const RayLanes* rays,
                                         Search* s) {
  if (!(top->root & BVH_LEAF_BIT)) {
    intersect_in_turn(scene, top, top->root, RBVH_NO_LEAF, rays, s);
    return;
  }
  const uint at = top->root & ~BVH_LEAF_BIT;
  const PatchInstance placed = scene->instances[at];
  const BvhRoot box = instance_box(scene->instances + at);
  RayLanes rays_there;
  place_lanes(placed.to_object, rays, &rays_there);
  intersect_in_turn(scene, &box, placed.root, at, &rays_there, s);
}

// As intersect_all(), as far as the rays stay together.
static inline void intersect_all_packet(const Scene* scene, const BvhRoot* top, const RayLanes* rays,
                                        Search* s, uint* visited) {
  if (top->root & BVH_LEAF_BIT) {
    intersect_instance_packet(scene, top->root & ~BVH_LEAF_BIT, rays, s, visited);
    return;
  }
  Packet p;
  if (!prepare_packet(rays, top, &p)) {
    intersect_all_in_turn(scene, top, rays, s);
    return;
  }
  float limits[PACKET];
  load_limits(&p, s, limits);
  uint stack[STACK], depth = 0, current = top->root;
  float stack_t[STACK];
  while (true) {
    uint next = 0;
    if (current & BVH_LEAF_BIT) {
      intersect_instance_packet(scene, current & ~BVH_LEAF_BIT, rays, s, visited);
      load_limits(&p, s, limits);
    } else {
      ++*visited;
      next = open_node_packet(scene->nodes + current, &p.bounds, greatest(vload16(0, limits)), stack, stack_t,
                              &depth);
    }
    const float limit = greatest(vload16(0, limits));
    if (next == 0) next = pop_nearer(stack, stack_t, &depth, limit);
    if (next == 0) return;
    current = next;
  }
}

// cast_top(), 16 rays a work-item. Neighbours' nearest hits are looked for together; what they visit so each
// of them counts.
__kernel void cast_top_packets(CAST_TOP_ARGUMENTS) {
  const uint begin = PACKET * (uint)get_global_id(0), count = active ? counts[2] : most_rays;
  if (begin >= count) return;
  const uint here = min((uint)PACKET, count - begin);
  const Scene scene = {nodes, instances, patches, parts, slots, cache, links};
  const Pairs pairs = {pair_keys, pair_rays, pair_places, counts, listed, pair_ranges};
  const bool is_fresh = !active && !range.keep_hits;
  Ray packet[PACKET];
  Search s[PACKET];
  uint numbers[PACKET];
  for (uint i = 0; i < here; ++i) {
    const uint r = numbers[i] = ray_number(active, range, begin + i);
    packet[i] = rays[r];
    begin_search(s + i, packet + i, any, at_once, most, detail);
    if (active) s[i].few.after = progress[r];
    if (!is_fresh) begin_after(s + i, hits[r]);
  }
  RayLanes lanes;
  load_lanes(packet, here, &lanes);
  uint visited = 0;
  if (any || active)
    intersect_all_in_turn(&scene, &top, &lanes, s);
  else
    intersect_all_packet(&scene, &top, &lanes, s, &visited);
  for (uint i = 0; i < here; ++i) {
    s[i].visited += visited;
    end_search(s + i, numbers[i], is_fresh, &pairs, hits, progress, steps);
  }
}
#endif

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
      const uint mask = intersect_planes16(j->parts[job.patch].planes, &q, &pr, found.t, &entry);
      tree.wanted =
          wanted_level(p, detail_of(j->detail, ray_speed(&ray)), nearest_entry(mask, entry), job.slot.level);
      visited = 1 + (built ? traverse_patch(&tree, p, j->links, &q, &pr, mask, entry, j->any, &found)
                           : intersect_unbuilt(&tree, &q, mask, entry, j->any, &found));
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
                           __global const PatchBlock* cache, __global const uint* links,
                           __global const uint* places, __global const uint* pair_rays,
                           __global const Ray* rays, uint any, RayDetail detail, __global const Hit* hits,
                           __global Hit* pair_hits, __global uint* pair_steps, NEAREST nearest) {
  TAKE_FROM_QUEUE(queue, job_count, {
    const Jobs j = {jobs,      instances, patches, parts,     map,        cache,   links,  places,
                    pair_rays, rays,      hits,    pair_hits, pair_steps, nearest, detail, any};
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
__kernel void take_hits(__global const uint* active, uint count, uint any, __global const uint2* pair_ranges,
                        __global const Hit* pair_hits, NEAREST nearest, __global const RayProgress* progress,
                        __global Hit* hits, __global uint* next_active, __global uint* next_counts) {
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
  if (goes_on) next_active[atomic_inc(next_counts + 2)] = r;
}
