// The traversal of a wide hierarchy by a group of 16 rays. Rays that begin close together visit the same
// nodes near there: a node is read once for all of them, and each of its boxes is tested against all at once.
// Where few are left these go on one by one.
//
// STACK: entries that any ray can need.
#ifndef RBVH_GROUP_TRAVERSE_H
#define RBVH_GROUP_TRAVERSE_H
#include "kernels/bvh/found_lanes.h"
#include "kernels/bvh/ray_lanes.h"
#include "kernels/bvh/wide_traverse.h"

#define GROUP 16
#define FEWEST_TOGETHER 8  // rays; fewer go on one by one, which is faster then

// What a group's rays have still to visit. A child lies in a row; the stack has the rows' numbers.
typedef struct GroupStack {
  float16 enter[2 * STACK], leave[2 * STACK];  // where each ray does the child's box
  uint child[2 * STACK], rays[2 * STACK];
  uint end[2 * STACK];  // of the rows of its siblings
  uint rows[STACK];
  float distance[STACK];
  uint depth;
} GroupStack;

// Rays that are cast together, and the nearest hits so far.
typedef struct Group {
  PreparedLanes lanes;
  PreparedRay prepared[GROUP];
  float center[3];  // of the rays' origins
  Found16 found;
  uint16 nodes, leaves;  // visited
} Group;

#define OF_RAY(type, lanes, i) ((type*)&(lanes))[i]

static ALWAYS_INLINE Found found_of(const Group* g, uint i) {
  return (Found){OF_RAY(const float, g->found.t, i), 0.0f, 0.0f, OF_RAY(const uint, g->found.id, i), 0u};
}

static ALWAYS_INLINE void set_found(Group* g, uint i, const Found* found) {
  OF_RAY(float, g->found.t, i) = found->t;
  OF_RAY(float, g->found.u, i) = found->u;
  OF_RAY(float, g->found.v, i) = found->v;
  OF_RAY(uint, g->found.id, i) = found->id;
  OF_RAY(uint, g->found.at, i) = found->at;
}

#pragma OPENCL FP_CONTRACT ON

// Squares of the distances of the node's boxes from a point; FLT_MAX and more of unused slots.
static ALWAYS_INLINE float16 distances_of_children(__global const WideNode* node, const float* p) {
  float16 sum = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 aside =
        max(max(vload16(0, node->planes[axis]) - p[axis], p[axis] - vload16(0, node->planes[axis + 3])),
            (float16)(0.0f));
    sum += aside * aside;
  }
  return sum;
}

// Puts the children that any of `rays` enters before its hit on the stack, farthest from the group first;
// where it does by the arithmetic of intersect_children(). Rows are free from `row` on; returns where from
// now on.
static ALWAYS_INLINE uint open_node_group(__global const WideNode* node, const Group* g, uint rays, uint row,
                                          GroupStack* s) {
#define LANES(row) vload16(0, g->lanes.row)
  const float16 inverse[3] = {LANES(inverse[0]), LANES(inverse[1]), LANES(inverse[2])},
                near[3] = {LANES(near_offset[0]), LANES(near_offset[1]), LANES(near_offset[2])},
                far[3] = {LANES(far_offset[0]), LANES(far_offset[1]), LANES(far_offset[2])};
  const float16 tmin = LANES(tmin), limits = g->found.t, distances = distances_of_children(node, g->center);
#undef LANES
  float distance[16];
  vstore16(distances, 0, distance);
  const uint first = row, bottom = s->depth;
  uint depth = bottom;
  for (uint used = lane_bits16(distances <= FLT_MAX); used != 0; used &= used - 1) {
    const uint slot = lowest_bit(used);
    __global const float* planes = (__global const float*)node->planes + slot;
#define PLANE(row, of) (planes[16 * (row)] * inverse[(row) % 3] + of[(row) % 3])
    const float16 enter = max(max(min(PLANE(0, near), PLANE(3, near)), min(PLANE(1, near), PLANE(4, near))),
                              max(min(PLANE(2, near), PLANE(5, near)), tmin));
    const float16 leave = min(min(max(PLANE(0, far), PLANE(3, far)), max(PLANE(1, far), PLANE(4, far))),
                              min(max(PLANE(2, far), PLANE(5, far)), limits));
#undef PLANE
    const uint entering = lane_bits16(enter <= leave) & rays;
    if (entering == 0) continue;
    s->enter[row] = enter;
    s->leave[row] = leave;
    s->child[row] = node->children[slot];
    s->rays[row] = entering;
    const float own = distance[slot];
    uint at = depth++;
    for (; at > bottom && s->distance[at - 1] < own; --at) {
      s->rows[at] = s->rows[at - 1];
      s->distance[at] = s->distance[at - 1];
    }
    s->rows[at] = row;
    s->distance[at] = own;
    ++row;
  }
#pragma unroll 1  // as vectors it is slower
  for (uint i = first; i < row; ++i) s->end[i] = row;
  s->depth = depth;
  return row;
}

#pragma OPENCL FP_CONTRACT OFF

// Defines  void NAME(const TREE* tree, uint any, uint rays, Group* group): `rays`, as bits, are cast.
//   void ASK_CHILD(tree, child): asks for the memory of a node or leaf;
//   uint CULL(tree, leaf, group, rays, enter, leave): those of the rays that may hit anything in a leaf,
//   whose box they enter and leave there; LEAF: as for DEFINE_TRAVERSE, by one ray; TRAVERSE, OCCLUDED: what
//   the above define.
#define DEFINE_TRAVERSE_GROUP(NAME, TREE, ASK_CHILD, CULL, LEAF, TRAVERSE, OCCLUDED)                \
  static ALWAYS_INLINE void NAME(const TREE* tree, uint any, uint rays, Group* g) {                 \
    GroupStack s;                                                                                   \
    s.depth = 0;                                                                                    \
    uint current = tree->scene->root, row = 0, at = 0, open = rays;                                 \
    s.enter[0] = -FLT_MAX, s.leave[0] = FLT_MAX;                                                    \
    for (;;) {                                                                                      \
      const bool is_leaf = (current & BVH_LEAF_BIT) != 0;                                           \
      if (!is_leaf && popcount(rays) >= FEWEST_TOGETHER) {                                          \
        if (!IN_BOUNDS(tree->bounds, NODES, current, 1)) return;                                    \
        g->nodes -= as_uint16(lanes_of_bits16(rays));                                               \
        const uint end = open_node_group(tree->nodes + current, g, rays, row, &s);                  \
        for (uint i = row; i < end; ++i) ASK_CHILD(tree, s.child[i]);                               \
      } else {                                                                                      \
        if (is_leaf) rays = CULL(tree, current & ~BVH_LEAF_BIT, g, rays, s.enter[at], s.leave[at]); \
        for (uint left = rays; left != 0; left &= left - 1) {                                       \
          const uint i = lowest_bit(left);                                                          \
          Found found = found_of(g, i);                                                             \
          const float t = found.t;                                                                  \
          const uint id = found.id;                                                                 \
          uint2 visited = (uint2)(0u);                                                              \
          if (is_leaf)                                                                              \
            LEAF(tree, current & ~BVH_LEAF_BIT, g->prepared + i, any, &found, &visited);            \
          else                                                                                      \
            visited = any ? OCCLUDED(tree, current, g->prepared + i, &found)                        \
                          : TRAVERSE(tree, current, g->prepared + i, 0, &found);                    \
          OF_RAY(uint, g->nodes, i) += visited.x;                                                   \
          OF_RAY(uint, g->leaves, i) += visited.y;                                                  \
          if (found.t == t && found.id == id) continue;                                             \
          set_found(g, i, &found);                                                                  \
          if (any) open &= ~(1u << i); /* done with its first hit */                                \
        }                                                                                           \
      }                                                                                             \
      do {                                                                                          \
        if (s.depth == 0) return;                                                                   \
        at = s.rows[--s.depth];                                                                     \
        rays = s.rays[at] & open & lane_bits16(s.enter[at] <= g->found.t);                          \
      } while (rays == 0);                                                                          \
      current = s.child[at];                                                                        \
      row = s.end[at];                                                                              \
    }                                                                                               \
  }
#endif
