// bvh-stack: the binary hierarchy by one ray a work-item with a stack, as everyone does it (Aila, Laine,
// "Understanding the Efficiency of Ray Traversal on GPUs", HPG 2009, its while-while kernel): a node holds
// its children's boxes, the nearer child is next, the other waits on the stack with the distance to it.
//
//   NodePair, 64 bytes: the boxes of both children, one row a plane, then the children
//   | lo.x 0 1 | lo.y 0 1 | lo.z 0 1 | hi.x 0 1 | hi.y 0 1 | hi.z 0 1 | child 0 | child 1 | unused |
//   child: a node, or with BVH_LEAF_BIT the first of the leaf's triangles, the last of which is marked
//
// STACK: entries that any ray can need.
#include "kernels/bvh/node_pair.h"
#include "kernels/bvh/bvh_triangle.h"

#define NODE NodePair
#define PRIMITIVE BvhTriangle
#include "kernels/trace/exact_tree.h"

static uint2 traverse(const Tree* tree, const PreparedRay* q, uint any, Found* found) {
  uint stack[STACK];
  float stack_t[STACK];
  uint depth = 0, current = tree->scene->root;
  uint2 visited = (uint2)(0u);
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
        stack[depth] = node->children[1 - nearer];
        stack_t[depth++] = nearer ? entry.x : entry.y;
        current = node->children[nearer];
        continue;
      }
      if (hits != 0) {
        current = node->children[hits - 1];
        continue;
      }
    }
    do {
      if (depth == 0) return visited;
      --depth;
    } while (stack_t[depth] > found->t);
    current = stack[depth];
  }
}

#include "kernels/trace/exact_kernels.h"
