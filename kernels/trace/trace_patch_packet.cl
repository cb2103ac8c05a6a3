// Rays search instances and patches (as in trace_patch.cl), 16 rays a work-item on a CPU: coherent rays as a
// packet, others interleaved.
#include "kernels/trace/patch_interleave.h"
#include "kernels/trace/patch_packet.h"

// The t up to which ray i still searches; -infinity where it can hit nothing.
static inline void load_limits(const Packet* p, const Search* s, float* limits) {
  for (uint i = 0; i < PACKET; ++i) limits[i] = p->lanes >> i & 1 ? search_limit(s + i) : -INFINITY;
}

static inline void intersect_patch_packet(const PatchScene* scene, __global const PatchInstance* instance,
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

static inline void intersect_instance_packet(const PatchScene* scene, uint at, const RayLanes* world,
                                             Search* s, uint* visited) {
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
    intersect_interleaved(scene, &box, instance->root, at, &rays, s);
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
      next = open_node_packet(scene->nodes + current, &p.interval, greatest(vload16(0, limits)), stack,
                              stack_t, &depth);
    }
    const float limit = greatest(vload16(0, limits));
    if (next == 0) next = pop_nearer(stack, stack_t, &depth, limit);
    if (next == 0) return;
    current = next;
  }
}

// All instances.
static inline void intersect_all_packet(const PatchScene* scene, const BvhRoot* top, const RayLanes* rays,
                                        Search* s, uint* visited) {
  if (top->root & BVH_LEAF_BIT) {
    intersect_instance_packet(scene, top->root & ~BVH_LEAF_BIT, rays, s, visited);
    return;
  }
  Packet p;
  if (!prepare_packet(rays, top, &p)) {
    intersect_all_interleaved(scene, top, rays, s);
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
      next = open_node_packet(scene->nodes + current, &p.interval, greatest(vload16(0, limits)), stack,
                              stack_t, &depth);
    }
    const float limit = greatest(vload16(0, limits));
    if (next == 0) next = pop_nearer(stack, stack_t, &depth, limit);
    if (next == 0) return;
    current = next;
  }
}

// The rays of `search`, 16 a work-item; see SEARCH_BUFFERS. What a packet visits counts for each of its rays.
__kernel void search_patches_packet(PatchSearch search, SEARCH_BUFFERS) {
  const uint begin = PACKET * (uint)get_global_id(0), count = ray_count(active, counts, search.most_rays);
  if (begin >= count) return;
  const uint here = min((uint)PACKET, count - begin);
  const PatchScene scene = SEARCH_SCENE;
  const RayQueue queue = SEARCH_QUEUE;
  const bool is_fresh = !active && !search.range.keep_hits;
  Ray packet[PACKET];
  Search s[PACKET];
  uint numbers[PACKET];
  for (uint i = 0; i < here; ++i) {
    const uint r = numbers[i] = ray_number(active, search.range, begin + i);
    packet[i] = rays[r];
    begin_search(s + i, packet + i, &search);
    if (active) s[i].few.after = progress[r];
    if (!is_fresh) begin_after(s + i, hits[r]);
  }
  RayLanes lanes;
  load_lanes(packet, here, &lanes);
  uint visited = 0;
  if (search.any || active)  // what is left of a round is seldom coherent
    intersect_all_interleaved(&scene, &search.top, &lanes, s);
  else
    intersect_all_packet(&scene, &search.top, &lanes, s, &visited);
  for (uint i = 0; i < here; ++i) {
    s[i].visited += visited;
    end_search(s + i, numbers[i], is_fresh, &queue, hits, progress, steps);
  }
}
