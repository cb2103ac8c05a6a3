// Rays search instances and patches, one ray a work-item, without tessellating the patches (Harada,
// "Rendering Vector Displacement Mapped Surfaces in a GPU Ray Tracer", GPU Pro 6, sections 1.4 and 1.5). A
// ray intersects a built patch at once. Patches that are not built become work items: these are sorted by
// patch, hierarchies are built (build_patches.cl), and cast_patches.cl intersects each patch with all its
// rays.
//
// GROUP, WIDE: see build_patches.cl; STACK, MOST: see patch_search.h.
#include "kernels/trace/patch_search.h"

// All patches of an instance, nearest box first.
static inline void intersect_instance(const PatchScene* scene, uint at, const Ray* world, Search* s) {
  __global const PatchInstance* instance = scene->instances + at;
  const Ray ray = instance_ray(instance, world);
  PreparedRay q;
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

// All instances.
static inline void intersect_all(const PatchScene* scene, const BvhRoot* top, const Ray* ray, Search* s) {
  if (s->any && s->leaf_before != RBVH_NO_LEAF) return;
  if (top->root & BVH_LEAF_BIT) {
    intersect_instance(scene, top->root & ~BVH_LEAF_BIT, ray, s);
    return;
  }
  PreparedRay q;
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

// The rays of `search`; see SEARCH_BUFFERS.
__kernel void search_patches(PatchSearch search, SEARCH_BUFFERS) {
  const uint i = (uint)get_global_id(0);
  if (i >= ray_count(active, counts, search.most_rays)) return;
  const uint r = ray_number(active, search.range, i);
  const Ray ray = rays[r];
  const PatchScene scene = SEARCH_SCENE;
  const RayQueue queue = SEARCH_QUEUE;
  const bool is_fresh = !active && !search.range.keep_hits;
  Search s;
  begin_search(&s, &ray, &search);
  if (active) s.few.after = progress[r];
  if (!is_fresh) begin_after(&s, hits[r]);
  intersect_all(&scene, &search.top, &ray, &s);
  end_search(&s, r, is_fresh, &queue, hits, progress, steps);
}
