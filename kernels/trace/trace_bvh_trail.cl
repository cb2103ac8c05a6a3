// bvh-trail: the binary hierarchy without a stack, by restart trail (Laine, "Restart Trail for Stackless BVH
// Traversal", HPG 2010). One bit a level tells whether all but one of the node's children are done with
// there:
//   both children hit, bit clear: to the nearer; the other is still to come
//   both hit, bit set:            the nearer is done: to the other
//   one hit:                      to it; the bit is set, nothing is to come
// To go on after a leaf, the deepest clear bit is set, those below it are cleared (an addition), and the
// traversal begins anew at the root, led by the bits. Order and boxes do not depend on what was found
// meanwhile, but the limit does: a child may no longer be hit. Where that happens at the very bit just set,
// what remains is the nearer child, which is done.
//
// Most traversals go on close to where they were: the last few nodes passed by are kept (his short stack,
// section 3), and only when those are used up does the traversal begin at the root.
//
// Node: NodePair, as trace_bvh_stack.cl draws it.
//
// TRAIL_WORDS: 64 bits each; 1 for trees of up to 64 levels, else 2.
#include "kernels/bvh/node_pair.h"
#include "kernels/bvh/bvh_triangle.h"

#define NODE NodePair
#define PRIMITIVE BvhTriangle
#include "kernels/trace/exact_tree.h"

#define KEPT 4u  // nodes passed by, a power of two

// The root's bit is the highest, so that adding at a level carries into those above it.
#if TRAIL_WORDS == 1
typedef ulong Trail;
static inline Trail no_trail(void) { return 0; }
static inline bool trail_bit(Trail trail, uint level) { return (trail << level) >> 63 != 0; }
static inline Trail with_trail_bit(Trail trail, uint level) { return trail | 1UL << (63 - level); }
// Sets the deepest clear bit at or above `level`, clears those below it. Returns its level; all ones: none.
static inline uint trail_advance(Trail* trail, uint level) {
  const ulong bit = 1UL << (63 - level);
  *trail = (*trail & (0UL - bit)) + bit;
  return *trail == 0 ? UINT_MAX : (uint)clz(*trail & (0UL - *trail));
}
#else
typedef ulong2 Trail;  // x: the upper levels
static inline Trail no_trail(void) { return (Trail)(0UL); }
static inline bool trail_bit(Trail trail, uint level) {
  return ((level < 64 ? trail.x : trail.y) << level % 64) >> 63 != 0;
}
static inline Trail with_trail_bit(Trail trail, uint level) {
  const ulong bit = 1UL << (63 - level % 64);
  return level < 64 ? (Trail)(trail.x | bit, trail.y) : (Trail)(trail.x, trail.y | bit);
}
static inline uint trail_advance(Trail* trail, uint level) {
  const ulong bit = 1UL << (63 - level % 64);
  if (level >= 64) {
    trail->y = (trail->y & (0UL - bit)) + bit;
    if (trail->y != 0) return 64 + (uint)clz(trail->y & (0UL - trail->y));
    ++trail->x;
  } else {
    trail->y = 0;
    trail->x = (trail->x & (0UL - bit)) + bit;
  }
  return trail->x == 0 ? UINT_MAX : (uint)clz(trail->x & (0UL - trail->x));
}
#endif

static uint2 traverse(const Tree* tree, const PreparedRay* q, uint any, Found* found) {
  uint2 visited = (uint2)(0u);
  Trail trail = no_trail();
  uint passed[KEPT], newest = 0, kept = 0;
  uint current = tree->scene->root, level = 0,
       set_last = UINT_MAX;  // the level whose bit was last set to go on
  while (true) {
    if (current & BVH_LEAF_BIT) {
      if (intersect_triangles(tree->primitives, current & ~BVH_LEAF_BIT, q, any, found, &visited) && any)
        return visited;
    } else {
      ++visited.x;
      __global const NodePair* node = tree->nodes + current;
      float2 entry;
      const uint hits = intersect_pair(node, q, found->t, &entry);
      if (hits == 3) {
        const uint nearer = entry.y < entry.x ? 1 : 0;
        const bool is_done = trail_bit(trail, level);
        if (!is_done) {
          passed[newest++ % KEPT] = node->children[1 - nearer];
          kept = min(kept + 1, KEPT);
        }
        current = node->children[is_done ? 1 - nearer : nearer];
        ++level;
        continue;
      }
      if (hits != 0 && level != set_last) {
        trail = with_trail_bit(trail, level);
        current = node->children[hits - 1];
        ++level;
        continue;
      }
    }
    if (level == 0) return visited;
    set_last = trail_advance(&trail, level - 1);
    if (set_last == UINT_MAX) return visited;
    if (kept > 0) {
      --kept;
      current = passed[--newest % KEPT];
      level = set_last + 1;
    } else {
      current = tree->scene->root;
      level = 0;
    }
  }
}

#include "kernels/trace/exact_kernels.h"
