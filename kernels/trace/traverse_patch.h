// From a patch's box to its micro-quads: 16 boxes at once (WIDE), or one node after the other along skip
// links, as in listing 1.1 of Harada, "Rendering Vector Displacement Mapped Surfaces in a GPU Ray Tracer",
// GPU Pro 6. As there, a ray that resolves less than the hierarchy holds takes a box for the surface.
#ifndef RBVH_TRAVERSE_PATCH_H
#define RBVH_TRAVERSE_PATCH_H
#include "kernels/trace/micro_quad.h"

// Takes a node's box for the surface: a hit at t.
static inline void take_box(__global const PatchBlock* block, uint lane, float t, PatchFound* found) {
  const uint n = block->normals[lane], uv = block->uvs[lane];
  found->t = t;
  found->u = (float)(uv & 0xffff) / 65535.0f;
  found->v = (float)(uv >> 16) / 65535.0f;
  found->normal[0] = (float)((int)(n << 21) >> 21) / 1023.0f;
  found->normal[1] = (float)((int)(n << 10) >> 21) / 1023.0f;
  found->normal[2] = (float)((int)n >> 22) / 511.0f;
  found->hit = FOUND_BOX;
}

#ifdef WIDE
// Entries of a traversal's stack: 15 every other level, and the 16 parts.
#define PATCH_STACK 112

// A stack entry: a block's index, the level of its nodes, and which quarters of it as bits (0: all).
#define VISIT(at, level, quarters) ((at) + ((level) << 24) + ((quarters) << 28))

// Repeats each of four bits four times.
static inline uint four_times(uint bits) {
  bits = (bits | bits << 6) & 0x303u;
  return ((bits | bits << 3) & 0x1111u) * 15u;
}

// The blocks of a large map are rarely in a cache: prefetches several at once.
static inline void prefetch_blocks(__global const PatchBlock* blocks, uint first, uint mask) {
  for (; mask != 0; mask &= mask - 1) ASK(blocks + first + lowest_bit(mask), sizeof(PatchBlock));
}

// Where to begin in a patch of level 2 or more, whose parts in `parts` the ray intersects; 0: nowhere.
static inline uint first_visit(const PatchTree* tree, uint loose, uint parts, float16 parts_entry,
                               uint* stack, float* stack_t, uint* depth) {
  const uint level = tree->level;
  if (parts == 0) return 0;
  if (loose || level < 4) return level & 1 ? VISIT(0u, 1u, 8u) : VISIT(1u, 2u, 0u);
  if (!(level & 1)) {
    prefetch_blocks(tree->blocks, 6, parts);
    return take_children(0, VISIT(6u, 4u, 0u), parts, parts_entry, stack, stack_t, depth);
  }
  // A part's children fill a quarter of a block.
  float t[16];
  vstore16(parts_entry, 0, t);
  for (uint k = 0; k < 4; ++k) {
    const uint quarters = parts >> 4 * k & 15;
    if (quarters == 0) continue;
    prefetch_blocks(tree->blocks, 2 + k, 1);
    float first_t = INFINITY;
    for (uint rest = quarters; rest != 0; rest &= rest - 1)
      first_t = min(first_t, t[4 * k + lowest_bit(rest)]);
    uint at = (*depth)++;
    for (; at > 0 && stack_t[at - 1] < first_t; --at) {
      stack[at] = stack[at - 1];
      stack_t[at] = stack_t[at - 1];
    }
    stack[at] = VISIT(2 + k, 3u, quarters);
    stack_t[at] = first_t;
  }
  return stack[--*depth];
}

// Visits stack entry `current`; returns the next one, 0 when the traversal is done.
static ALWAYS_INLINE uint visit_patch(const PatchTree* tree, uint current, const PreparedRay* q,
                                      const PatchRay* ray, uint any, uint* stack, float* stack_t, uint* depth,
                                      PatchFound* found, uint* visited) {
  ++*visited;
  const uint at = current & 0xffffff, at_level = current >> 24 & 15, quarters = current >> 28;
  uint next = 0;
  if (at_level == tree->level) {
    *visited += intersect_leaves(tree, at - block_count(tree->level), q, any, found);
    if (any && found->hit > FOUND_BEFORE) return 0;
  } else {
    __global const PatchBlock* block = tree->blocks + at;
    float16 entry;
    uint mask = intersect_planes16(block->planes, q, ray, found->t, &entry);
    if (quarters != 0) mask &= four_times(quarters);
    if (mask != 0 && at_level >= tree->wanted) {
      // These boxes stand for the surface. The ray does not hit those it starts in.
      const uint outside = mask & lane_bits16(entry > q->tmin);
      if (outside != 0) {
        float t[16];
        vstore16(entry, 0, t);
        uint lane = lowest_bit(outside);
        for (uint rest = outside & (outside - 1); rest != 0; rest &= rest - 1)
          if (t[lowest_bit(rest)] < t[lane]) lane = lowest_bit(rest);
        if (t[lane] < found->t) take_box(block, lane, t[lane], found);
        if (any) return 0;
        mask &= ~outside;
      }
    }
    if (mask != 0) {
      const uint first = PATCH_WIDTH * at - PATCH_FIRST_LANE;  // lane 0's node
      prefetch_blocks(tree->blocks, first + 1, mask);
      next = take_children(0, VISIT(first + 1, at_level + 2, 0u), mask, entry, stack, stack_t, depth);
    }
  }
  return next != 0 ? next : pop_nearer(stack, stack_t, depth, found->t);
}

// All micro-quads of a patch of a level below 2. Returns how many.
static inline uint intersect_few_leaves(const PatchTree* tree, const PreparedRay* q, PatchFound* found) {
  const uint count = 1u << 2 * tree->level;
  for (uint m = 0; m < count; ++m) intersect_micro_quad(tree, m, q, found);
  return count;
}

// Nearest hit, or any. `parts` and `parts_entry`: which of the patch's 16 parts the ray intersects, and where
// it enters them. Returns blocks and micro-quads visited.
static uint traverse_patch(const PatchTree* tree, __global const Patch* p, __global const uint* links,
                           const PreparedRay* q, const PatchRay* ray, uint parts, float16 parts_entry,
                           uint any, PatchFound* found) {
  if (tree->level < 2) return intersect_few_leaves(tree, q, found);
  uint stack[PATCH_STACK], depth = 0, visited = 0;
  float stack_t[PATCH_STACK];
  uint current = first_visit(tree, p->loose, parts, parts_entry, stack, stack_t, &depth);
  while (current != 0)
    current = visit_patch(tree, current, q, ray, any, stack, stack_t, &depth, found, &visited);
  return visited;
}
#else
#define LINK_END 0xffffu  // nothing follows

static inline uint child_link(__global const uint* links, uint deep, uint node) {
  return deep ? 4 * node + 1 : links[node] >> 16;
}
static inline uint skip_link(__global const uint* links, uint deep, uint node) {
  if (!deep) return links[node] & 0xffff;
  while (node != 0 && node % 4 == 0) node = (node - 1) / 4;
  return node == 0 ? 0xffffffffu : node + 1;
}

static uint traverse_patch(const PatchTree* tree, __global const Patch* p, __global const uint* links,
                           const PreparedRay* q, const PatchRay* ray, uint parts, float16 parts_entry,
                           uint any, PatchFound* found) {
  if (parts == 0) return 0;
  const uint leaves = first_node(tree->level), boxes = first_node(tree->wanted);
  const uint deep = tree->level > PATCH_LINKED_LEVEL, end = deep ? 0xffffffffu : LINK_END;
  uint node = 0, visited = 0;
  while (node != end) {
    ++visited;
    const uint at = node + PATCH_FIRST_LANE, lane = at % PATCH_WIDTH;
    __global const PatchBlock* block = tree->blocks + at / PATCH_WIDTH;
    float enter = q->tmin, leave = found->t;
    for (uint axis = 0; axis < 3; ++axis) {
      enter =
          max(enter, mad((float)block->planes[q->near_row[axis]][lane], ray->scale[axis], ray->near[axis]));
      leave = min(leave, mad((float)block->planes[q->far_row[axis]][lane], ray->scale[axis], ray->far[axis]));
    }
    if (!(enter <= leave)) {
      node = skip_link(links, deep, node);
    } else if (node >= leaves) {
      if (intersect_micro_quad(tree, node - leaves, q, found) && any) return visited;
      node = skip_link(links, deep, node);
    } else if (node >= boxes && enter > q->tmin) {
      if (enter < found->t) take_box(block, lane, enter, found);
      if (any) return visited;
      node = skip_link(links, deep, node);
    } else {
      node = child_link(links, deep, node);
    }
  }
  return visited;
}
#endif
#endif
