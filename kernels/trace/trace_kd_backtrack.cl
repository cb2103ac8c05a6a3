// kd-backtrack: the kd-tree without a stack, by links to the parents (Foley, Sugerman, "KD-Tree Acceleration
// Structures for a GPU Raytracer", GH 2005). After a leaf the traversal goes up until there is a far child
// that the ray enters; the part of the ray inside a cell is had from the cell's box, so that nothing need be
// remembered but the node. Which child the traversal comes up from tells what is done: their distance along
// the ray would not, where planes are crossed within rounding of each other.
//
//   KdCellNode, 40 bytes
//   | lo.x | lo.y | lo.z | link | hi.x | hi.y | hi.z | parent | position | unused |
//   link: axis (2 bits), first child (30): below, then above; in a leaf 3, first reference; position: count
#include "kernels/bvh/kd_node.h"

#define NODE KdCellNode
#define PRIMITIVE BvhTriangle
#include "kernels/trace/exact_tree.h"

static uint2 traverse(const Tree* tree, const PreparedRay* q, uint any, Found* found) {
  uint2 visited = (uint2)(0u);
  uint current = 0;
  float2 t = scene_interval(tree->scene, q);  // the part of the ray in the node's cell
  if (!(t.x <= min(t.y, found->t))) return visited;
  while (true) {
    // Down, to the nearer child where both are hit.
    ++visited.x;
    __global const KdCellNode* node = tree->nodes + current;
    uint axis = node->link & 3, first = node->link >> 2;
    if (axis != KD_LEAF) {
      const float2 plane = plane_crossing(node->position, axis, q);
      const uint side = near_side(axis, q);
      if (t.x > plane.y) {
        current = first + (1 - side);
        t.x = max(t.x, plane.x);
      } else {
        current = first + side;
        t.y = min(t.y, plane.y);
      }
      continue;
    }
    if (intersect_references(tree->primitives, tree->references, first, as_uint(node->position), q, any,
                             found, &visited) &&
        any)
      return visited;
    // Up, until a child has a far sibling that the ray enters before what was found.
    while (true) {
      if (current == 0) return visited;
      const uint child = current;
      current = node->parent;
      node = tree->nodes + current;
      axis = node->link & 3;
      first = node->link >> 2;
      ++visited.x;
      const uint side = near_side(axis, q);
      if (child != first + side) continue;
      const float2 plane = plane_crossing(node->position, axis, q);
      if (plane.x > found->t) continue;
      t = box_interval(vload3(0, node->lo), vload3(0, node->hi), q);
      t.x = max(t.x, plane.x);
      if (t.x > min(t.y, found->t)) continue;
      current = first + (1 - side);
      break;
    }
  }
}

#include "kernels/trace/exact_kernels.h"
