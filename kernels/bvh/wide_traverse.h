// The traversal of a wide hierarchy, by one ray or a packet, with a hook for its leaves: near children first,
// the others on a stack with the distance to them.
//
// STACK: entries that any ray can need.
#ifndef RBVH_WIDE_TRAVERSE_H
#define RBVH_WIDE_TRAVERSE_H
#include "kernels/bvh/wide_node.h"
#include "kernels/common/bounds.h"

// The nodes are every kernel's first argument.
#define NODES 0u, sizeof(WideNode)

// Defines  uint2 NAME(const TREE* tree, const RAYS* rays, uint any, FOUND* found):
// nodes and leaves (or what these count) visited. TREE has nodes, a scene and BOUNDS_MEMBER.
//   uint OPEN(node, rays, limit, stack, stack_t, depth): as open_node();
//   bool LEAF(tree, leaf, rays, any, found, visited): true where it found something nearer;
//   float LIMIT(found): how far the rays still go.
#define DEFINE_TRAVERSE(NAME, TREE, RAYS, FOUND, OPEN, LEAF, LIMIT)                             \
  static ALWAYS_INLINE uint2 NAME(const TREE* tree, const RAYS* rays, uint any, FOUND* found) { \
    uint stack[STACK];                                                                          \
    float stack_t[STACK];                                                                       \
    uint depth = 0, current = tree->scene->root;                                                \
    uint2 visited = (uint2)(0u);                                                                \
    float limit = LIMIT(found);                                                                 \
    do {                                                                                        \
      while (!(current & BVH_LEAF_BIT)) {                                                       \
        ++visited.x;                                                                            \
        if (!IN_BOUNDS(tree->bounds, NODES, current, 1)) return visited;                        \
        current = OPEN(tree->nodes + current, rays, limit, stack, stack_t, &depth);             \
        if (current == 0) break; /* the root, and no child */                                   \
      }                                                                                         \
      if (current != 0) {                                                                       \
        if (LEAF(tree, current & ~BVH_LEAF_BIT, rays, any, found, &visited)) {                  \
          if (any) return visited;                                                              \
          limit = LIMIT(found);                                                                 \
        }                                                                                       \
      }                                                                                         \
      current = pop_nearer(stack, stack_t, &depth, limit);                                      \
    } while (current != 0);                                                                     \
    return visited;                                                                             \
  }
#endif
