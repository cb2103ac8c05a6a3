// bvh-parent: the binary hierarchy without a stack, by links to the parents (Hapala, Davidovic, Wald, Havran,
// Slusallek, "Efficient Stack-less BVH Traversal for Ray Tracing", SCCG 2011). The only state is the node,
// and whether the traversal came to it from above, from its nearer sibling, or from below. Which child is the
// nearer one must be the same on the way down and up: the ray's sign along the axis that parts them decides.
//
//   ParentNode, 32 bytes: the node's own box and its links; node 0 is the root, node 1 is not used, so that
//   siblings differ in the lowest bit
//   | lo.x | lo.y | lo.z | down | hi.x | hi.y | hi.z | up |
//   down: leaf (bit 31), axis that parts the children (29, 30), first child or first triangle
//   up:   axis that parts it from its sibling (bits 29, 30), parent
#include "kernels/bvh/box.h"
#include "kernels/bvh/bvh_triangle.h"

#define NODE ParentNode
#define PRIMITIVE BvhTriangle
#include "kernels/trace/exact_tree.h"

// 1 where the second of two children parted along the link's axis comes first on the ray.
static inline uint nearer(uint link, const PreparedRay* q) { return q->near_row[link >> 29 & 3] > 2 ? 1 : 0; }

static uint2 traverse(const Tree* tree, const PreparedRay* q, uint any, Found* found) {
  uint2 visited = (uint2)(0u);
  uint current = 0;
  bool is_first = true;  // of the two siblings: came from above
  while (true) {
    ++visited.x;
    __global const ParentNode* node = tree->nodes + current;
    const float2 t = box_interval(vload3(0, node->lo), vload3(0, node->hi), q);
    if (t.x <= min(t.y, found->t)) {
      const uint down = node->down;
      if (!(down & BVH_LEAF_BIT)) {
        current = (down & PARENT_INDEX_MASK) + nearer(down, q);
        is_first = true;
        continue;
      }
      if (intersect_triangles(tree->primitives, down & PARENT_INDEX_MASK, q, any, found, &visited) && any)
        return visited;
    }
    // Done with this node: up, until there is a sibling to go to.
    while (true) {
      if (current == 0) return visited;
      if (is_first) break;
      current = tree->nodes[current].up & PARENT_INDEX_MASK;
      is_first = (current & 1) == nearer(tree->nodes[current].up, q);
    }
    current ^= 1;
    is_first = false;
  }
}

#include "kernels/trace/exact_kernels.h"
