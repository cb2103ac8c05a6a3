// wide16: a 16-wide hierarchy over triangles (default) or discs (-DDISCS). One ray a work-item: the ray meets all
// boxes of a node, and all primitives of a block, in one vector instruction each. Or 16 rays of a camera a work-item
// (triangles only): the bounds of the rays meet all boxes of a node at once, and each triangle meets all rays. The
// default: nothing is faster on a CPU with wide vectors.
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

// Takes the nearest of the children in `mask` (not 0), puts the others on the stack, farthest first.
static inline uint take_children(__global const ExactNode* node, uint mask, float16 entry, uint* stack,
                                 float* stack_t, uint* depth_inout) {
  uint lane = lowest_bit(mask);
  mask &= mask - 1;
  uint next = node->children[lane];
  if (mask == 0) return next;
  float t[16];
  vstore16(entry, 0, t);
  float next_t = t[lane];
  uint depth = *depth_inout;
  const uint bottom = depth;
  for (; mask != 0; mask &= mask - 1) {
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
  *depth_inout = depth;
  return next;
}

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
      const uint mask = meet_children(node, q, found->t, &entry);
      if (mask != 0) next = take_children(node, mask, entry, stack, stack_t, &depth);
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

#ifndef DISCS
// --- packets: 16 rays from one point that agree in their longest axis and in all signs

// What was found, by ray.
typedef struct Found16 {
  float16 t, u, v;
  uint16 id, at;
} Found16;

typedef struct Packet {
  float origin[3];
  uint kx, ky, kz;
  float16 sx, sy, sz;
  // The least and the greatest inverse direction, and their offsets, as in Query.
  float inverse[3][2], near_offset[3][2], far_offset[3][2];
  uint near_row[3], far_row[3];
} Packet;

// False where the rays do not agree.
static bool prepare_packet(const Ray* rays, const ExactScene* scene, Packet* p) {
  float sx[16], sy[16], sz[16];
  Query q, first;
  for (uint i = 0; i < 16; ++i) {
    if (!prepare(rays + i, scene, &q)) return false;
    if (i == 0) first = q;
    sx[i] = q.sx;
    sy[i] = q.sy;
    sz[i] = q.sz;
    if (q.kz != first.kz) return false;
    for (uint axis = 0; axis < 3; ++axis) {
      if (q.near_row[axis] != first.near_row[axis]) return false;
      p->inverse[axis][0] = i == 0 ? q.inverse[axis] : min(p->inverse[axis][0], q.inverse[axis]);
      p->inverse[axis][1] = i == 0 ? q.inverse[axis] : max(p->inverse[axis][1], q.inverse[axis]);
    }
  }
  p->kx = first.kx;
  p->ky = first.ky;
  p->kz = first.kz;
  p->sx = vload16(0, sx);
  p->sy = vload16(0, sy);
  p->sz = vload16(0, sz);
  const float margin = error_bound(first.origin, scene);
  for (uint axis = 0; axis < 3; ++axis) {
    const float o = first.origin[axis], outwards = copysign(margin, first.inverse[axis]);
    p->origin[axis] = o;
    p->near_row[axis] = first.near_row[axis];
    p->far_row[axis] = first.far_row[axis];
    for (uint k = 0; k < 2; ++k) {
      p->near_offset[axis][k] = -(o + outwards) * p->inverse[axis][k];
      p->far_offset[axis][k] = -(o - outwards) * p->inverse[axis][k];
    }
  }
  return true;
}

// Children that any of the rays may meet before `limit`; `entry`: not before it.
static inline uint meet_children_packet(__global const ExactNode* node, const Packet* p, float limit,
                                        float16* entry) {
  float16 enter = 0.0f, leave = limit;
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 near = vload16(0, node->planes[p->near_row[axis]]);
    const float16 far = vload16(0, node->planes[p->far_row[axis]]);
    enter = max(enter, min(mad(near, (float16)(p->inverse[axis][0]), (float16)(p->near_offset[axis][0])),
                           mad(near, (float16)(p->inverse[axis][1]), (float16)(p->near_offset[axis][1]))));
    leave = min(leave, max(mad(far, (float16)(p->inverse[axis][0]), (float16)(p->far_offset[axis][0])),
                           mad(far, (float16)(p->inverse[axis][1]), (float16)(p->far_offset[axis][1]))));
  }
  *entry = enter;
  return lane_bits16(enter <= leave);
}

// meet_block() the other way round: one triangle, 16 rays. The arithmetic is the same, so the hits are.
static inline bool meet_triangle_packet(__global const ExactBlock* b, uint lane, uint at, const Packet* p,
                                        Found16* found) {
  const float ox = p->origin[p->kx], oy = p->origin[p->ky], oz = p->origin[p->kz];
  const float16 az = b->rows[p->kz][lane] - oz, bz = b->rows[p->kz + 3][lane] - oz,
                cz = b->rows[p->kz + 6][lane] - oz;
  const float16 ax = (b->rows[p->kx][lane] - ox) - p->sx * az, ay = (b->rows[p->ky][lane] - oy) - p->sy * az;
  const float16 bx = (b->rows[p->kx + 3][lane] - ox) - p->sx * bz,
                by = (b->rows[p->ky + 3][lane] - oy) - p->sy * bz;
  const float16 cx = (b->rows[p->kx + 6][lane] - ox) - p->sx * cz,
                cy = (b->rows[p->ky + 6][lane] - oy) - p->sy * cz;
  float16 u = cx * by - cy * bx;
  float16 v = ax * cy - ay * cx;
  float16 w = bx * ay - by * ax;
#ifdef cl_khr_fp64
  const int16 unsure = (u == 0.0f) | (v == 0.0f) | (w == 0.0f);
  if (lane_bits16(unsure)) {
    const double16 dax = convert_double16(ax), day = convert_double16(ay), dbx = convert_double16(bx),
                   dby = convert_double16(by), dcx = convert_double16(cx), dcy = convert_double16(cy);
    u = select(u, convert_float16(dcx * dby - dcy * dbx), unsure);
    v = select(v, convert_float16(dax * dcy - day * dcx), unsure);
    w = select(w, convert_float16(dbx * day - dby * dax), unsure);
  }
#endif
  const int16 outside = ((u < 0.0f) | (v < 0.0f) | (w < 0.0f)) & ((u > 0.0f) | (v > 0.0f) | (w > 0.0f));
  const float16 area = u + v + w;
  if (lane_bits16(~outside & (area != 0.0f)) == 0) return false;
  const float16 t = (u * (p->sz * az) + v * (p->sz * bz) + w * (p->sz * cz)) / area;
  const uint id = b->ids[lane];
  const int16 nearer = (t < found->t) | ((t == found->t) & ((uint16)(id) < found->id));
  const int16 taken = ~outside & (area != 0.0f) & (t >= 0.0f) & nearer;
  if (lane_bits16(taken) == 0) return false;
  found->t = select(found->t, t, taken);
  found->u = select(found->u, v / area, taken);
  found->v = select(found->v, w / area, taken);
  found->id = select(found->id, (uint16)(id), taken);
  found->at = select(found->at, (uint16)(at), taken);
  return true;
}

static inline float greatest(float16 v) {
  const float8 v8 = max(v.lo, v.hi);
  const float4 v4 = max(v8.lo, v8.hi);
  const float2 v2 = max(v4.lo, v4.hi);
  return max(v2.x, v2.y);
}

// As traverse(), nearest hits. Returns what the packet visited.
static uint2 traverse_packet(const Tree* tree, const Packet* p, Found16* found) {
  uint stack[STACK];
  float stack_t[STACK];
  uint depth = 0, current = tree->scene->root;
  uint2 visited = (uint2)(0u);
  float limit = FLT_MAX;  // the farthest of what was found
  while (true) {
    uint next = 0;
    if (current & EXACT_LEAF_BIT) {
      ++visited.y;
      const uint block = current & ~EXACT_LEAF_BIT;
      __global const ExactBlock* b = tree->primitives + block;
      bool taken = false;
      for (uint lane = 0; lane < EXACT_BLOCK_WIDTH && b->ids[lane] != RBVH_NO_LEAF; ++lane) {
        taken |= meet_triangle_packet(b, lane, block * EXACT_BLOCK_WIDTH + lane, p, found);
      }
      if (taken) limit = greatest(found->t);
    } else {
      ++visited.x;
      __global const ExactNode* node = tree->nodes + current;
      float16 entry;
      const uint mask = meet_children_packet(node, p, limit, &entry);
      if (mask != 0) next = take_children(node, mask, entry, stack, stack_t, &depth);
    }
    while (next == 0) {
      if (depth == 0) return visited;
      --depth;
      if (stack_t[depth] <= limit) next = stack[depth];
    }
    current = next;
  }
}

// A square of 4 x 4 pixels a work-item; `squares` of them in a row.
__kernel void trace_camera_packets(__global const ExactNode* nodes, __global const ExactBlock* blocks,
                                   __global const uint* references, ExactScene scene, CameraRays camera,
                                   uint squares, __global Hit* hits, __global uint* steps) {
  const uint left = (uint)get_global_id(0) % squares * 4, top = (uint)get_global_id(0) / squares * 4;
  if (top >= camera.height) return;
  const Tree tree = {nodes, blocks, references, &scene};
  Ray rays[16];
  for (uint i = 0; i < 16; ++i) {  // beyond the edge: the last pixel again
    rays[i] = camera_ray(&camera, min(left + i % 4, camera.width - 1), min(top + i / 4, camera.height - 1));
  }
  Found found[16];
  uint visited[16];
  Packet packet;
  if (prepare_packet(rays, &scene, &packet)) {
    Found16 all;
    all.t = FLT_MAX;
    all.u = all.v = 0.0f;
    all.id = RBVH_NO_LEAF;
    all.at = 0;
    const uint2 both = traverse_packet(&tree, &packet, &all);
    float t[16], u[16], v[16];
    uint id[16], at[16];
    vstore16(all.t, 0, t);
    vstore16(all.u, 0, u);
    vstore16(all.v, 0, v);
    vstore16(all.id, 0, id);
    vstore16(all.at, 0, at);
    for (uint i = 0; i < 16; ++i) {
      found[i] = (Found){t[i], u[i], v[i], id[i], at[i]};
      visited[i] = both.x + both.y;
    }
  } else {
    for (uint i = 0; i < 16; ++i) {
      const uint2 both = trace(&tree, rays + i, 0, found + i);
      visited[i] = both.x + both.y;
    }
  }
  for (uint i = 0; i < 16; ++i) {
    const uint x = left + i % 4, y = top + i / 4;
    if (x >= camera.width || y >= camera.height) continue;
    hits[y * camera.width + x] = make_hit(found + i, blocks, rays + i);
    if (steps) steps[y * camera.width + x] = visited[i];
  }
}
#endif
