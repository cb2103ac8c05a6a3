// wide16: a 16-wide hierarchy over triangles (default) or discs (-DDISCS), one ray a work-item: the ray meets
// all boxes of a node, and all primitives of a block, in one vector instruction each. The default: nothing is
// faster on a CPU with wide vectors.
//
//   ExactNode, 448 bytes: the boxes of 16 children, one row of 16 floats a plane, then the children
//   | lo.x 0..15 | lo.y 0..15 | lo.z 0..15 | hi.x 0..15 | hi.y 0..15 | hi.z 0..15 | child 0..15 |
//   ExactBlock, 320 bytes: 8 triangles or discs, one row of 8 floats a number, then their indices
//   | a.x 0..7 | a.y 0..7 | a.z 0..7 | b.x 0..7 | ... | c.z 0..7 | id 0..7 |
//
// STACK: entries that any ray can need.
#include "exact_query.h"
#include "lanes.h"

#define NODE ExactNode
#define PRIMITIVE ExactBlock
#include "exact_tree.h"

// Children met between tmin and `limit`, as bits; where in `entry`.
static inline uint meet_children(__global const ExactNode* node, const Query* q, float limit,
                                 float16* entry) {
#define PLANES(row, i, offset) \
  mad(vload16(0, node->planes[q->row[i]]), (float16)(q->inverse[i]), (float16)(q->offset[i]))
  const float16 enter = max(max(PLANES(near_row, 0, near_offset), PLANES(near_row, 1, near_offset)),
                            max(PLANES(near_row, 2, near_offset), (float16)(q->tmin)));
  const float16 leave = min(min(PLANES(far_row, 0, far_offset), PLANES(far_row, 1, far_offset)),
                            min(PLANES(far_row, 2, far_offset), (float16)(limit)));
#undef PLANES
  *entry = enter;
  return lane_bits16(enter <= leave);
}

// Takes the lanes in `mask` over into `found` where they are nearer.
static inline bool take_nearest(uint mask, float8 t8, float8 u8, float8 v8, __global const ExactBlock* blocks,
                                uint block, Found* found) {
  float t[8], u[8], v[8];
  vstore8(t8, 0, t);
  vstore8(u8, 0, u);
  vstore8(v8, 0, v);
  bool any = false;
  for (; mask != 0; mask &= mask - 1) {
    const uint lane = lowest_bit(mask);
    const uint id = blocks[block].ids[lane];
    if (is_nearer(t[lane], id, found)) {
      *found = (Found){t[lane], u[lane], v[lane], id, block * EXACT_BLOCK_WIDTH + lane};
      any = true;
    }
  }
  return any;
}

#ifndef DISCS
// U, V, W: twice the signed areas of the triangle's parts opposite a, b and c, seen along the ray.
static inline bool meet_block(__global const ExactBlock* blocks, uint block, const Query* q, Found* found) {
  __global const ExactBlock* b = blocks + block;
  const float8 ox = q->origin[q->kx], oy = q->origin[q->ky], oz = q->origin[q->kz];
  const float8 az = vload8(0, b->rows[q->kz]) - oz;
  const float8 bz = vload8(0, b->rows[q->kz + 3]) - oz;
  const float8 cz = vload8(0, b->rows[q->kz + 6]) - oz;
  const float8 ax = (vload8(0, b->rows[q->kx]) - ox) - q->sx * az;
  const float8 ay = (vload8(0, b->rows[q->ky]) - oy) - q->sy * az;
  const float8 bx = (vload8(0, b->rows[q->kx + 3]) - ox) - q->sx * bz;
  const float8 by = (vload8(0, b->rows[q->ky + 3]) - oy) - q->sy * bz;
  const float8 cx = (vload8(0, b->rows[q->kx + 6]) - ox) - q->sx * cz;
  const float8 cy = (vload8(0, b->rows[q->ky + 6]) - oy) - q->sy * cz;
  float8 u = cx * by - cy * bx;
  float8 v = ax * cy - ay * cx;
  float8 w = bx * ay - by * ax;
#ifdef cl_khr_fp64
  const int8 unsure = (u == 0.0f) | (v == 0.0f) | (w == 0.0f);
  if (lane_bits8(unsure)) {
    // Products of floats are exact in double: now a zero is a zero. Only where there was one, or hits would
    // depend on who else is in the block.
    const double8 dax = convert_double8(ax), day = convert_double8(ay), dbx = convert_double8(bx),
                  dby = convert_double8(by), dcx = convert_double8(cx), dcy = convert_double8(cy);
    u = select(u, convert_float8(dcx * dby - dcy * dbx), unsure);
    v = select(v, convert_float8(dax * dcy - day * dcx), unsure);
    w = select(w, convert_float8(dbx * day - dby * dax), unsure);
  }
#endif
  const int8 outside = ((u < 0.0f) | (v < 0.0f) | (w < 0.0f)) & ((u > 0.0f) | (v > 0.0f) | (w > 0.0f));
  const float8 area = u + v + w;
  if (lane_bits8(~outside & (area != 0.0f)) == 0) return false;
  const float8 t = (u * (q->sz * az) + v * (q->sz * bz) + w * (q->sz * cz)) / area;
  const uint mask = lane_bits8(~outside & (area != 0.0f) & (t >= q->tmin) & (t <= found->t));
  return mask != 0 && take_nearest(mask, t, v / area, w / area, blocks, block, found);
}

static inline float3 unit_normal(__global const ExactBlock* blocks, uint at) {
  __global const ExactBlock* b = blocks + at / EXACT_BLOCK_WIDTH;
  const uint i = at % EXACT_BLOCK_WIDTH;
  return triangle_normal((float3)(b->rows[0][i], b->rows[1][i], b->rows[2][i]),
                         (float3)(b->rows[3][i], b->rows[4][i], b->rows[5][i]),
                         (float3)(b->rows[6][i], b->rows[7][i], b->rows[8][i]));
}
#else
// Two unit vectors across a unit normal (Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017).
static inline void disc_frame(float3 n, float3* x, float3* y) {
  const float sign = copysign(1.0f, n.z), a = -1.0f / (sign + n.z), b = n.x * n.y * a;
  *x = (float3)(1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x);
  *y = (float3)(b, sign + n.y * n.y * a, -n.y);
}

static inline float3 unit_normal(__global const ExactBlock* blocks, uint at) {
  __global const ExactBlock* b = blocks + at / EXACT_BLOCK_WIDTH;
  const uint i = at % EXACT_BLOCK_WIDTH;
  return (float3)(b->rows[3][i], b->rows[4][i], b->rows[5][i]);
}

static inline bool meet_block(__global const ExactBlock* blocks, uint block, const Query* q, Found* found) {
  __global const ExactBlock* b = blocks + block;
  // From the origin to the centres.
  const float8 cx = vload8(0, b->rows[0]) - q->origin[0];
  const float8 cy = vload8(0, b->rows[1]) - q->origin[1];
  const float8 cz = vload8(0, b->rows[2]) - q->origin[2];
  const float8 nx = vload8(0, b->rows[3]), ny = vload8(0, b->rows[4]), nz = vload8(0, b->rows[5]);
  const float8 radius = vload8(0, b->rows[6]);
  const float8 slope = nx * q->direction[0] + ny * q->direction[1] + nz * q->direction[2];
  const float8 t = (cx * nx + cy * ny + cz * nz) / slope;
  const float8 rx = t * q->direction[0] - cx, ry = t * q->direction[1] - cy, rz = t * q->direction[2] - cz;
  uint mask = lane_bits8((slope != 0.0f) & (rx * rx + ry * ry + rz * rz <= radius * radius) & (t >= q->tmin) &
                         (t <= found->t));
  if (mask == 0 || !take_nearest(mask, t, t, t, blocks, block, found)) return false;
  const uint lane = found->at % EXACT_BLOCK_WIDTH;
  const float3 centre = (float3)(b->rows[0][lane], b->rows[1][lane], b->rows[2][lane]);
  const float3 origin = (float3)(q->origin[0], q->origin[1], q->origin[2]);
  const float3 direction = (float3)(q->direction[0], q->direction[1], q->direction[2]);
  const float3 r = (found->t * direction - (centre - origin)) / b->rows[6][lane];
  float3 x, y;
  disc_frame(unit_normal(blocks, found->at), &x, &y);
  found->u = dot(r, x);
  found->v = dot(r, y);
  return true;
}
#endif

static uint2 traverse(const Tree* tree, const Query* q, uint any, Found* found) {
  uint stack[STACK];
  float stack_t[STACK];
  uint depth = 0, current = tree->scene->root;
  uint2 visited = (uint2)(0u);
  while (true) {
    uint next = 0;  // nearest child met; 0 is the root and no child
    if (current & EXACT_LEAF_BIT) {
      ++visited.y;
      if (meet_block(tree->primitives, current & ~EXACT_LEAF_BIT, q, found) && any) return visited;
    } else {
      ++visited.x;
      __global const ExactNode* node = tree->nodes + current;
      float16 entry;
      uint mask = meet_children(node, q, found->t, &entry);
      if (mask != 0) {
        uint lane = lowest_bit(mask);
        mask &= mask - 1;
        next = node->children[lane];
        if (mask != 0) {
          float t[16];
          vstore16(entry, 0, t);
          float next_t = t[lane];
          const uint bottom = depth;
          for (; mask != 0; mask &= mask - 1) {  // the farther ones go on the stack, farthest first
            lane = lowest_bit(mask);
            uint far = node->children[lane];
            float far_t = t[lane];
            if (far_t < next_t) {
              const uint swap = next;
              const float swap_t = next_t;
              next = far;
              next_t = far_t;
              far = swap;
              far_t = swap_t;
            }
            uint at = depth++;
            for (; at > bottom && stack_t[at - 1] < far_t; --at) {
              stack[at] = stack[at - 1];
              stack_t[at] = stack_t[at - 1];
            }
            stack[at] = far;
            stack_t[at] = far_t;
          }
        }
      }
    }
    while (next == 0) {
      if (depth == 0) return visited;
      --depth;
      if (stack_t[depth] <= found->t) next = stack[depth];
    }
    current = next;
  }
}

#include "exact_entries.h"
