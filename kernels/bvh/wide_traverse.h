// The traversal of a wide hierarchy, by one ray or a beam, with a hook for its leaves: near children first,
// the others on a stack with the distance to them.
//
// STACK: entries that any ray can need.
#ifndef RBVH_WIDE_TRAVERSE_H
#define RBVH_WIDE_TRAVERSE_H
#include "kernels/bvh/wide_node.h"
#include "kernels/common/bounds.h"

// The nodes are every kernel's first argument.
#define NODES 0u, sizeof(WideNode)

// Defines  uint2 NAME(const TREE* tree, uint from, const RAYS* rays, uint any, FOUND* found):
// nodes and leaves (or what these count) visited, of those below `from`. `any`, of one ray: its first hit
// ends it. TREE has nodes, a scene and BOUNDS_MEMBER.
//   uint OPEN(node, rays, limit, stack, stack_t, depth): as open_node();
//   bool LEAF(tree, leaf, rays, any, found, visited): true where it found something nearer;
//   float LIMIT(found): how far the rays still go.
#define DEFINE_TRAVERSE(NAME, TREE, RAYS, FOUND, OPEN, LEAF, LIMIT)                                        \
  static ALWAYS_INLINE uint2 NAME(const TREE* tree, uint from, const RAYS* rays, uint any, FOUND* found) { \
    uint stack[STACK];                                                                                     \
    float stack_t[STACK];                                                                                  \
    uint depth = 0, current = from;                                                                        \
    uint2 visited = (uint2)(0u);                                                                           \
    float limit = LIMIT(found);                                                                            \
    do {                                                                                                   \
      while (!(current & BVH_LEAF_BIT)) {                                                                  \
        ++visited.x;                                                                                       \
        if (!IN_BOUNDS(tree->bounds, NODES, current, 1)) return visited;                                   \
        current = OPEN(tree->nodes + current, rays, limit, stack, stack_t, &depth);                        \
        if (current == 0) break; /* the root, and no child */                                              \
      }                                                                                                    \
      if (current != 0) {                                                                                  \
        if (LEAF(tree, current & ~BVH_LEAF_BIT, rays, any, found, &visited)) {                             \
          if (any) return visited;                                                                         \
          limit = LIMIT(found);                                                                            \
        }                                                                                                  \
      }                                                                                                    \
      current = pop_nearer(stack, stack_t, &depth, limit);                                                 \
    } while (current != 0);                                                                                \
    return visited;                                                                                        \
  }

// Defines  uint2 NAME(tree, from, q, found): whether a ray is occluded up to found->t, and by what. As
// the first hit ends it, children are not sorted: the largest is visited first (they are stored so).
#define DEFINE_OCCLUDED(NAME, TREE, LEAF)                                                            \
  static ALWAYS_INLINE uint2 NAME(const TREE* tree, uint from, const PreparedRay* q, Found* found) { \
    uint stack[STACK], depth = 0, current = from;                                                    \
    uint2 visited = (uint2)(0u);                                                                     \
    for (;;) {                                                                                       \
      if (current & BVH_LEAF_BIT) {                                                                  \
        if (LEAF(tree, current & ~BVH_LEAF_BIT, q, 1, found, &visited)) break;                       \
      } else {                                                                                       \
        ++visited.x;                                                                                 \
        if (!IN_BOUNDS(tree->bounds, NODES, current, 1)) break;                                      \
        __global const WideNode* node = tree->nodes + current;                                       \
        float16 entry;                                                                               \
        uint mask = intersect_children(node, q, found->t, &entry);                                   \
        if (mask != 0) {                                                                             \
          current = node->children[lowest_bit(mask)];                                                \
          for (mask &= mask - 1; mask != 0; mask &= mask - 1)                                        \
            stack[depth++] = node->children[lowest_bit(mask)];                                       \
          continue;                                                                                  \
        }                                                                                            \
      }                                                                                              \
      if (depth == 0) break;                                                                         \
      current = stack[--depth];                                                                      \
    }                                                                                                \
    return visited;                                                                                  \
  }
#endif
