// kd-pushdown: the kd-tree without a stack, by restarts from as deep as can be (Horn, Sugerman, Houston,
// Hanrahan, "Interactive k-D Tree GPU Raytracing", I3D 2007). After a leaf the traversal begins anew, not at
// the root but at the deepest node that everything still to come lies below: as long as nothing waits above,
// the start is pushed down with the traversal.
//
// Their traversal tells what is done by how far along the ray it is. Where several planes are crossed within
// rounding of each other that would skip cells, so a bit a level tells it instead, as in trace_bvh_trail.cl:
// set where all but one of the node's children are done with. The start's own bit is always clear: if it were
// set the start would move down. The last few cells passed by are kept (their short stack, section 3.3): only
// when those are used up does the traversal begin at the start.
//
// Node: KdCutNode, as trace_kd_stack.cl draws it.
#include "kernels/bvh/kd_node.h"

#define NODE KdCutNode
#define PRIMITIVE BvhTriangle
#include "kernels/trace/exact_tree.h"

#define KEPT 4u  // cells passed by, a power of two

static uint2 traverse(const Tree* tree, const PreparedRay* q, uint any, Found* found) {
  uint2 visited = (uint2)(0u);
  uint start = 0, current = 0;
  float2 start_t = scene_interval(tree->scene, q);  // the part of the ray in the start's cell
  float2 t = start_t;
  ulong trail = 0;  // highest bit: the start's level
  uint level = 0;   // of `current` below the start
  uint set_last = UINT_MAX;
  uint passed[KEPT], newest = 0, kept = 0;
  float2 passed_t[KEPT];
  if (!(t.x <= min(t.y, found->t))) return visited;
  while (true) {
    ++visited.x;
    const KdCutNode node = tree->nodes[current];
    const uint axis = node.link & 3, first = node.link >> 2;
    if (axis != KD_LEAF) {
      const float2 plane = plane_crossing(node.position, axis, q);
      const uint side = near_side(axis, q);
      const bool near_hit = !(t.x > plane.y), far_hit = !near_hit || !(plane.x > min(t.y, found->t));
      const ulong bit = 1UL << (63 - level);
      const bool both = near_hit && far_hit;
      if (both || level != set_last) {
        const bool to_far = both ? (trail & bit) != 0 : far_hit;
        if (both && !to_far) {
          passed[newest % KEPT] = first + (1 - side);
          passed_t[newest++ % KEPT] = (float2)(max(t.x, plane.x), t.y);
          kept = min(kept + 1, KEPT);
        }
        current = first + (to_far ? 1 - side : side);
        if (to_far) {
          t.x = max(t.x, plane.x);
        } else {
          t.y = min(t.y, plane.y);
        }
        if (!both) trail |= bit;
        if (level == 0 && (trail & bit)) {
          start = current;
          start_t = t;
          trail <<= 1;
          set_last = set_last == UINT_MAX || set_last == 0 ? UINT_MAX : set_last - 1;
        } else {
          ++level;
        }
        continue;
      }
      // What remains here is the nearer child, which is done.
    } else if (intersect_references(tree->primitives, tree->references, first, as_uint(node.position), q, any,
                                    found, &visited) &&
               any) {
      return visited;
    }
    do {
      if (level == 0) return visited;  // nothing waits
      const ulong last = 1UL << (64 - level);
      trail = (trail & (0UL - last)) + last;  // sets the deepest clear bit; the start's is clear
      set_last = (uint)clz(trail & (0UL - trail));
      if (kept > 0) {
        --kept;
        current = passed[--newest % KEPT];
        t = passed_t[newest % KEPT];
        level = set_last + 1;
        if (set_last == 0) {  // the start's far child: nothing waits above it
          start = current;
          start_t = t;
          trail = 0;
          level = 0;
          set_last = UINT_MAX;
        }
      } else {
        current = start;
        t = start_t;
        level = 0;
      }
    } while (t.x > found->t);
  }
}

#include "kernels/trace/exact_kernels.h"
