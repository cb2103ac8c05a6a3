// kd-stack: the kd-tree with a stack (Havran, "Heuristic Ray Shooting Algorithms", 2000, its recursive
// algorithm): the nearer child is next, with the part of the ray before the plane; the other waits on the
// stack with the part behind it.
//
//   KdCutNode, 8 bytes
//   inner: | position | axis (2 bits), first child (30): below, then above |
//   leaf:  | count    | 3    (2 bits), first reference (30)                |
//
// STACK: entries that any ray can need.
#include "kernels/bvh/kd_node.h"

#define NODE KdCutNode
#define PRIMITIVE BvhTriangle
#include "kernels/trace/exact_tree.h"

static uint2 traverse(const Tree* tree, const PreparedRay* q, uint any, Found* found) {
  uint stack[STACK];
  float2 stack_t[STACK];
  uint depth = 0, current = 0;
  uint2 visited = (uint2)(0u);
  float2 t = scene_interval(tree->scene, q);  // the part of the ray in the node's cell
  if (!(t.x <= min(t.y, found->t))) return visited;
  while (true) {
    ++visited.x;
    const KdCutNode node = tree->nodes[current];
    const uint axis = node.link & 3, first = node.link >> 2;
    if (axis != KD_LEAF) {
      const float2 plane = plane_crossing(node.position, axis, q);
      const uint side = near_side(axis, q);
      const bool far_hit = !(plane.x > min(t.y, found->t));
      if (t.x > plane.y) {
        current = first + (1 - side);
        t.x = max(t.x, plane.x);
      } else {
        if (far_hit) {
          stack[depth] = first + (1 - side);
          stack_t[depth++] = (float2)(max(t.x, plane.x), t.y);
        }
        current = first + side;
        t.y = min(t.y, plane.y);
      }
      continue;
    }
    if (intersect_references(tree->primitives, tree->references, first, as_uint(node.position), q, any, found,
                             &visited) &&
        any)
      return visited;
    do {
      if (depth == 0) return visited;
      --depth;
    } while (stack_t[depth].x > found->t);
    current = stack[depth];
    t = stack_t[depth];
  }
}

#include "kernels/trace/exact_kernels.h"
