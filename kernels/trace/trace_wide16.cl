// wide16: a 16-wide hierarchy over triangles (default) or discs (-DDISCS). One ray a work-item: the ray meets
// all boxes of a node, and all primitives of a block, in one vector instruction each. Or 16 rays of a camera
// a work-item (triangles only): the bounds of the rays meet all boxes of a node at once, and each triangle
// meets all rays. The default: nothing is faster on a CPU with wide vectors.
//
//   WideNode, 448 bytes: the boxes of 16 children, one row of 16 floats a plane, then the children
//   | lo.x 0..15 | lo.y 0..15 | lo.z 0..15 | hi.x 0..15 | hi.y 0..15 | hi.z 0..15 | child 0..15 |
//   PrimitiveBlock, 320 bytes: 8 triangles or discs, one row of 8 floats a number, then their indices
//   | a.x 0..7 | a.y 0..7 | a.z 0..7 | b.x 0..7 | ... | c.z 0..7 | id 0..7 |
//
// STACK: entries that any ray can need.
#include "kernels/bvh/ray_query.h"
#include "kernels/bvh/wide_node.h"

#define NODE WideNode
#define PRIMITIVE PrimitiveBlock
#include "kernels/trace/exact_tree.h"

// Takes the lanes in `mask` over into `found` where they are nearer.
static inline bool take_nearest(uint mask, float8 t8, float8 u8, float8 v8,
                                __global const PrimitiveBlock* blocks, uint block, Found* found) {
  float t[8], u[8], v[8];
  vstore8(t8, 0, t);
  vstore8(u8, 0, u);
  vstore8(v8, 0, v);
  bool any = false;
  for (; mask != 0; mask &= mask - 1) {
    const uint lane = lowest_bit(mask);
    const uint id = blocks[block].ids[lane];
    if (is_nearer(t[lane], id, found)) {
      *found = (Found){t[lane], u[lane], v[lane], id, block * PRIMITIVE_BLOCK_WIDTH + lane};
      any = true;
    }
  }
  return any;
}

#ifndef DISCS
// U, V, W: twice the signed areas of the triangle's parts opposite a, b and c, seen along the ray.
static inline bool intersect_block(__global const PrimitiveBlock* blocks, uint block, const Query* q,
                                   Found* found) {
  __global const PrimitiveBlock* b = blocks + block;
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

static inline float3 unit_normal(__global const PrimitiveBlock* blocks, uint at) {
  __global const PrimitiveBlock* b = blocks + at / PRIMITIVE_BLOCK_WIDTH;
  const uint i = at % PRIMITIVE_BLOCK_WIDTH;
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

static inline float3 unit_normal(__global const PrimitiveBlock* blocks, uint at) {
  __global const PrimitiveBlock* b = blocks + at / PRIMITIVE_BLOCK_WIDTH;
  const uint i = at % PRIMITIVE_BLOCK_WIDTH;
  return (float3)(b->rows[3][i], b->rows[4][i], b->rows[5][i]);
}

static inline bool intersect_block(__global const PrimitiveBlock* blocks, uint block, const Query* q,
                                   Found* found) {
  __global const PrimitiveBlock* b = blocks + block;
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
  const uint lane = found->at % PRIMITIVE_BLOCK_WIDTH;
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
    if (current & BVH_LEAF_BIT) {
      ++visited.y;
      if (intersect_block(tree->primitives, current & ~BVH_LEAF_BIT, q, found) && any) return visited;
    } else {
      ++visited.x;
      next = open_node(tree->nodes + current, q, found->t, stack, stack_t, &depth);
    }
    if (next == 0) next = pop_nearer(stack, stack_t, &depth, found->t);
    if (next == 0) return visited;
    current = next;
  }
}

#include "kernels/trace/exact_entries.h"

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

#define ALL_LANES 0xffffu

// False where the rays do not agree, or one is nearly parallel to a plane: prepare() knows about that.
static bool prepare_packet(const float* origin, const float16* d, const BvhRoot* scene, Packet* p) {
  const float16 x = fabs(d[0]), y = fabs(d[1]), z = fabs(d[2]);
  if (lane_bits16((x >= y) & (x >= z)) == ALL_LANES) {
    p->kz = 0;
  } else if (lane_bits16((y > x) & (y >= z)) == ALL_LANES) {
    p->kz = 1;
  } else if (lane_bits16((z > x) & (z > y)) == ALL_LANES) {
    p->kz = 2;
  } else {
    return false;
  }
  p->kx = (p->kz + 1) % 3;
  p->ky = (p->kz + 2) % 3;
  const float16 longest = fabs(d[p->kz]);
  p->sx = d[p->kx] / d[p->kz];
  p->sy = d[p->ky] / d[p->kz];
  p->sz = 1.0f / d[p->kz];
  const float margin = error_bound(origin, scene);
  for (uint axis = 0; axis < 3; ++axis) {
    if (!isfinite(origin[axis]) || lane_bits16(fabs(d[axis]) > 1e-18f * longest) != ALL_LANES) return false;
    const uint back = lane_bits16(d[axis] < 0.0f);
    if (back != 0 && back != ALL_LANES) return false;
    const float16 inverse = 1.0f / d[axis];
    p->inverse[axis][0] = -greatest(-inverse);
    p->inverse[axis][1] = greatest(inverse);
    p->origin[axis] = origin[axis];
    p->near_row[axis] = back ? axis + 3 : axis;
    p->far_row[axis] = back ? axis : axis + 3;
    const float outwards = back ? -margin : margin;
    for (uint k = 0; k < 2; ++k) {
      p->near_offset[axis][k] = -(origin[axis] + outwards) * p->inverse[axis][k];
      p->far_offset[axis][k] = -(origin[axis] - outwards) * p->inverse[axis][k];
    }
  }
  return true;
}

// Children that any of the rays may meet before `limit`; `entry`: not before it.
static inline uint intersect_children_packet(__global const WideNode* node, const Packet* p, float limit,
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

// Triangles of a block whose boxes any of the rays may meet before `limit`, as bits: most of a block's lie
// beside the packet.
static inline uint intersect_boxes_packet(__global const PrimitiveBlock* b, const Packet* p, float limit) {
  float8 enter = 0.0f, leave = limit;
  for (uint axis = 0; axis < 3; ++axis) {
    const float8 v0 = vload8(0, b->rows[axis]), v1 = vload8(0, b->rows[axis + 3]),
                 v2 = vload8(0, b->rows[axis + 6]);
    const float8 lo = min(v0, min(v1, v2)), hi = max(v0, max(v1, v2));
    const bool back = p->near_row[axis] > 2;
    const float8 near = back ? hi : lo, far = back ? lo : hi;
    enter = max(enter, min(mad(near, (float8)(p->inverse[axis][0]), (float8)(p->near_offset[axis][0])),
                           mad(near, (float8)(p->inverse[axis][1]), (float8)(p->near_offset[axis][1]))));
    leave = min(leave, max(mad(far, (float8)(p->inverse[axis][0]), (float8)(p->far_offset[axis][0])),
                           mad(far, (float8)(p->inverse[axis][1]), (float8)(p->far_offset[axis][1]))));
  }
  const float8 used = vload8(0, b->rows[0]);
  return lane_bits8((enter <= leave) & (used == used));
}

// intersect_block() the other way round: one triangle, 16 rays. The arithmetic is the same, so the hits are.
static inline bool intersect_triangle_packet(__global const PrimitiveBlock* b, uint lane, uint at,
                                             const Packet* p, Found16* found) {
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

// As traverse(), nearest hits. Returns what the packet visited.
static uint2 traverse_packet(const Tree* tree, const Packet* p, Found16* found) {
  uint stack[STACK];
  float stack_t[STACK];
  uint depth = 0, current = tree->scene->root;
  uint2 visited = (uint2)(0u);
  float limit = FLT_MAX;  // the farthest of what was found
  while (true) {
    uint next = 0;
    if (current & BVH_LEAF_BIT) {
      ++visited.y;
      const uint block = current & ~BVH_LEAF_BIT;
      __global const PrimitiveBlock* b = tree->primitives + block;
      bool taken = false;
      for (uint mask = intersect_boxes_packet(b, p, limit); mask != 0; mask &= mask - 1) {
        const uint lane = lowest_bit(mask);
        taken |= intersect_triangle_packet(b, lane, block * PRIMITIVE_BLOCK_WIDTH + lane, p, found);
      }
      if (taken) limit = greatest(found->t);
    } else {
      ++visited.x;
      __global const WideNode* node = tree->nodes + current;
      float16 entry;
      const uint mask = intersect_children_packet(node, p, limit, &entry);
      if (mask != 0) next = take_children(node->children, 0, mask, entry, stack, stack_t, &depth);
    }
    if (next == 0) next = pop_nearer(stack, stack_t, &depth, limit);
    if (next == 0) return visited;
    current = next;
  }
}

// camera_ray()'s directions of a square of 4 x 4 pixels.
static inline void square_directions(const CameraRays* camera, uint left, uint top, float16* d) {
  const float16 column = (float16)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
  const float16 row = (float16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
  const float16 sx = ((float16)((float)left) + column) + camera->offset_x;
  const float16 sy = ((float16)((float)top) + row) + camera->offset_y;
  for (int i = 0; i < 3; ++i) d[i] = camera->corner[i] + camera->right[i] * sx + camera->up[i] * sy;
  const float16 scale = 1.0f / sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  for (int i = 0; i < 3; ++i) d[i] = d[i] * scale;
}

// make_hit() for 16 rays.
static inline void make_hits(const Found16* found, __global const PrimitiveBlock* blocks, const float16* d,
                             Hit* hits) {
  float corners[9][16], t[16], u[16], v[16], normal[3][16];
  uint id[16], at[16];
  vstore16(found->t, 0, t);
  vstore16(found->u, 0, u);
  vstore16(found->v, 0, v);
  vstore16(found->id, 0, id);
  vstore16(found->at, 0, at);
  for (uint i = 0; i < 16; ++i) {
    __global const PrimitiveBlock* b = blocks + at[i] / PRIMITIVE_BLOCK_WIDTH;
    for (uint row = 0; row < 9; ++row) corners[row][i] = b->rows[row][at[i] % PRIMITIVE_BLOCK_WIDTH];
  }
  float16 ab[3], ac[3], n[3], e = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 a = vload16(0, corners[axis]);
    ab[axis] = vload16(0, corners[axis + 3]) - a;
    ac[axis] = vload16(0, corners[axis + 6]) - a;
    e = max(e, max(fabs(ab[axis]), fabs(ac[axis])));
  }
  const float16 scale = 1.0f / e;  // as in triangle_normal()
  for (uint axis = 0; axis < 3; ++axis) {
    ab[axis] *= scale;
    ac[axis] *= scale;
  }
  for (uint axis = 0; axis < 3; ++axis) {
    n[axis] = ab[(axis + 1) % 3] * ac[(axis + 2) % 3] - ab[(axis + 2) % 3] * ac[(axis + 1) % 3];
  }
  const float16 inverse_length = 1.0f / sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  for (uint axis = 0; axis < 3; ++axis) {
    n[axis] *= inverse_length;
    vstore16(n[axis], 0, normal[axis]);
  }
  const uint back = lane_bits16(n[0] * d[0] + n[1] * d[1] + n[2] * d[2] > 0.0f);
  for (uint i = 0; i < 16; ++i) {
    const bool hit = id[i] != RBVH_NO_LEAF;
    hits[i].t = hit ? t[i] : INFINITY;
    for (uint axis = 0; axis < 3; ++axis) hits[i].normal[axis] = hit ? normal[axis][i] : 0.0f;
    hits[i].u = hit ? u[i] : 0.0f;
    hits[i].v = hit ? v[i] : 0.0f;
    hits[i].leaf = id[i];
    hits[i].flags = hit ? RBVH_HIT_TRIANGLE_LEAF | (back >> i & 1 ? RBVH_HIT_BACK_FACE : 0u) : 0u;
  }
}

// A square of 4 x 4 pixels a work-item; `squares` of them in a row.
__kernel void trace_camera_packets(__global const WideNode* nodes, __global const PrimitiveBlock* blocks,
                                   __global const uint* references, BvhRoot scene, CameraRays camera,
                                   uint squares, __global Hit* hits, __global uint* steps) {
  const uint left = (uint)get_global_id(0) % squares * 4, top = (uint)get_global_id(0) / squares * 4;
  if (top >= camera.height) return;
  const Tree tree = {nodes, blocks, references, &scene};
  float16 d[3];
  square_directions(&camera, left, top, d);
  Hit square[16];
  uint visited[16];
  Packet packet;
  if (prepare_packet(camera.position, d, &scene, &packet)) {
    Found16 found;
    found.t = FLT_MAX;
    found.u = found.v = 0.0f;
    found.id = RBVH_NO_LEAF;
    found.at = 0;
    const uint2 both = traverse_packet(&tree, &packet, &found);
    make_hits(&found, blocks, d, square);
    for (uint i = 0; i < 16; ++i) visited[i] = both.x + both.y;
  } else {
    for (uint i = 0; i < 16; ++i) {
      const Ray ray = camera_ray(&camera, left + i % 4, top + i / 4);
      Found found;
      const uint2 both = trace(&tree, &ray, 0, &found);
      square[i] = make_hit(&found, blocks, &ray);
      visited[i] = both.x + both.y;
    }
  }
  for (uint i = 0; i < 16; ++i) {
    const uint x = left + i % 4, y = top + i / 4;
    if (x >= camera.width || y >= camera.height) continue;
    hits[y * camera.width + x] = square[i];
    if (steps) steps[y * camera.width + x] = visited[i];
  }
}
#endif
