// A patch's hierarchy met by one ray: 16 boxes at once (WIDE), or one node after the other along skip links,
// as in listing 1.1 of Harada, "Rendering Vector Displacement Mapped Surfaces in a GPU Ray Tracer", GPU
// Pro 6. Boxes only lead to the micro-quads: those are met as two triangles each, by the arithmetic of
// exact_triangle.h, so that hits are the tessellated mesh's to the last bit. A ray that wants less than the
// hierarchy has takes a box for the surface, as there.
#ifndef RBVH_PATCH_QUERY_H
#define RBVH_PATCH_QUERY_H
#include "kernels/bvh/ray_query.h"
#include "kernels/trace/patch_surface.h"
#include "kernels/bvh/wide_node.h"

// Entries that a traversal by 16s can have waiting: 15 every other level, and the 16 parts.
#define PATCH_STACK 112

// The nearest hit so far.
typedef struct PatchFound {
  float t;
  float u, v;       // in the patch, 0..1
  float normal[3];  // of the object's space, any length
  uint hit;         // FOUND_*; from FOUND_TRIANGLE on the micro-quad's first or second triangle
  uint at;          // the micro-quad
} PatchFound;

#define FOUND_NOTHING 0
#define FOUND_BEFORE 1  // by someone else
#define FOUND_BOX 2
#define FOUND_TRIANGLE 3  // u and v still weigh its second and third corner, see finish_found()

typedef struct PatchTree {
  __global const PatchBlock* blocks;
  __global const float* vertices;  // x y z, row by row, or grids; null where nothing is built
  uint level;
  uint wanted;  // levels that the ray can resolve; at most `level`
  // Where nothing is built: what vertices are made of.
  __global const Patch* patch;
  __global const float* map;
  uint edges;
} PatchTree;

static inline PatchTree built_tree(__global const PatchBlock* blocks, uint level) {
  const PatchTree tree = {blocks, slot_vertices(blocks, level), level, level, 0, 0, 0u};
  return tree;
}

// The ray's planes in quanta of the patch's box: t = quanta * scale + near, or far.
typedef struct PatchRay {
  float scale[3], near[3], far[3];
} PatchRay;

static inline PatchRay patch_ray(__global const Patch* p, const Query* q) {
  PatchRay r;
  for (uint axis = 0; axis < 3; ++axis) {
    const float lo = p->lo[axis];
    r.scale[axis] = (p->hi[axis] - lo) * (1.0f / 65535.0f) * q->inverse[axis];
    r.near[axis] = lo * q->inverse[axis] + q->near_offset[axis];
    r.far[axis] = lo * q->inverse[axis] + q->far_offset[axis];
  }
  return r;
}

// 16 boxes of quanta, as intersect_children().
static ALWAYS_INLINE uint intersect_planes16(__global const ushort (*planes)[PATCH_WIDTH], const Query* q,
                                             const PatchRay* r, float limit, float16* entry) {
#define PLANES(row, i, offset) \
  mad(convert_float16(vload16(0, planes[q->row[i]])), (float16)(r->scale[i]), (float16)(r->offset[i]))
  const float16 enter = max(max(PLANES(near_row, 0, near), PLANES(near_row, 1, near)),
                            max(PLANES(near_row, 2, near), (float16)(q->tmin)));
  const float16 leave = min(min(PLANES(far_row, 0, far), PLANES(far_row, 1, far)),
                            min(PLANES(far_row, 2, far), (float16)(limit)));
#undef PLANES
  *entry = enter;
  return lane_bits16(enter <= leave);
}

// The same in units of length, for a ray whose direction is `speed` long.
static inline RayDetail detail_of(RayDetail detail, float speed) {
  const RayDetail scaled = {detail.width * speed, detail.spread * speed};
  return scaled;
}

// The level that resolves what the ray does at t: micro-quads whose sides are about that long.
static inline uint wanted_level(__global const Patch* p, RayDetail detail, float t, uint most) {
  const float resolved = detail.width + detail.spread * max(t, 0.0f);
  const float pieces = p->size / resolved * 0.70710678f;  // the nearest power of two
  if (!(pieces < (float)(1u << PATCH_MOST_LEVEL))) return most;
  return pieces <= 1.0f ? 0u : min(most, ((as_uint(pieces) - 1) >> 23) - 126);
}

// A micro-quad's corners a b c d, one row an axis.
static inline void load_corners(const PatchTree* tree, uint m, float4* corners) {
  const uint side = (1u << tree->level) + 1, i = even_bits(m), j = even_bits(m >> 1);
  if (!tree->vertices) {
    const float3 a = patch_vertex(tree->patch, tree->map, tree->level, tree->edges, i, j);
    const float3 b = patch_vertex(tree->patch, tree->map, tree->level, tree->edges, i + 1, j);
    const float3 c = patch_vertex(tree->patch, tree->map, tree->level, tree->edges, i + 1, j + 1);
    const float3 d = patch_vertex(tree->patch, tree->map, tree->level, tree->edges, i, j + 1);
    corners[0] = (float4)(a.x, b.x, c.x, d.x);
    corners[1] = (float4)(a.y, b.y, c.y, d.y);
    corners[2] = (float4)(a.z, b.z, c.z, d.z);
    return;
  }
#ifdef WIDE
  if (tree->level >= 2) {
    __global const float* grid = tree->vertices + GRID_FLOATS * (m / PATCH_WIDTH) + 5 * (j % 4) + i % 4;
    for (uint axis = 0; axis < 3; ++axis) {
      const float2 ab = vload2(0, grid + GRID_AXIS * axis), dc = vload2(0, grid + GRID_AXIS * axis + 5);
      corners[axis] = (float4)(ab, dc.yx);
    }
    return;
  }
#endif
  __global const float* at = tree->vertices + 3 * (j * side + i);
  const float8 ab = vload8(0, at), dc = vload8(0, at + 3 * side);  // two floats more than needed
  corners[0] = (float4)(ab.s03, dc.s30);
  corners[1] = (float4)(ab.s14, dc.s41);
  corners[2] = (float4)(ab.s25, dc.s52);
}

// Micro-quad m of the finest level: triangles a b c and a c d. True where the hit is nearer.
static inline bool intersect_micro_quad(const PatchTree* tree, uint m, const Query* q, PatchFound* found) {
  float4 corners[3];
  load_corners(tree, m, corners);
  const float4 z = corners[q->kz] - q->origin[q->kz];
  const float4 x = (corners[q->kx] - q->origin[q->kx]) - q->sx * z;
  const float4 y = (corners[q->ky] - q->origin[q->ky]) - q->sy * z;
  // Twice the signed areas between the ray and the edges ab, bc, cd, da; and the diagonal ac.
  const float4 edge = x * y.yzwx - y * x.yzwx;
  const float ac = x.s0 * y.s2 - y.s0 * x.s2;
  const float4 tz = q->sz * z;
  bool taken = false;
  for (uint triangle = 0; triangle < 2; ++triangle) {
    // Opposite a, b, c; or a, c, d.
    float u = triangle ? -edge.z : -edge.y, v = triangle ? -edge.w : ac, w = triangle ? -ac : -edge.x;
#ifdef cl_khr_fp64
    if (u == 0.0f || v == 0.0f || w == 0.0f) {
      const double4 dx = convert_double4(x), dy = convert_double4(y);
      const double4 exact = dx * dy.yzwx - dy * dx.yzwx;
      const double exact_ac = dx.s0 * dy.s2 - dy.s0 * dx.s2;
      u = (float)(triangle ? -exact.z : -exact.y);
      v = (float)(triangle ? -exact.w : exact_ac);
      w = (float)(triangle ? -exact_ac : -exact.x);
    }
#endif
    if ((u < 0.0f || v < 0.0f || w < 0.0f) && (u > 0.0f || v > 0.0f || w > 0.0f)) continue;
    const float area = u + v + w;
    if (area == 0.0f) continue;
    const float t = (u * tz.x + v * (triangle ? tz.z : tz.y) + w * (triangle ? tz.w : tz.z)) / area;
    if (t >= q->tmin && (t < found->t || (t == found->t && !found->hit))) {
      found->t = t;
      found->u = v / area;
      found->v = w / area;
      found->hit = FOUND_TRIANGLE + triangle;
      found->at = m;
      taken = true;
    }
  }
  return taken;
}

// From a hit triangle to u, v in the patch and a normal.
static inline void finish_found(const PatchTree* tree, PatchFound* found) {
  if (found->hit < FOUND_TRIANGLE) return;
  const uint n = 1u << tree->level, second = found->hit - FOUND_TRIANGLE;
  const uint i = even_bits(found->at), j = even_bits(found->at >> 1);
  float4 corners[3];
  load_corners(tree, found->at, corners);
  const float v = found->u, w = found->v;
  // Two weights can be more than one by rounding.
  found->u = min(((float)i + (second ? v : v + w)) / (float)n, 1.0f);
  found->v = min(((float)j + (second ? v + w : w)) / (float)n, 1.0f);
  float p[3], r[3], largest = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    p[axis] = (second ? corners[axis].z : corners[axis].y) - corners[axis].x;
    r[axis] = (second ? corners[axis].w : corners[axis].z) - corners[axis].x;
    largest = max(largest, max(fabs(p[axis]), fabs(r[axis])));
  }
  const float3 a = (float3)(p[0], p[1], p[2]) / largest, b = (float3)(r[0], r[1], r[2]) / largest;
  const float3 normal = cross(a, b);
  found->normal[0] = normal.x;
  found->normal[1] = normal.y;
  found->normal[2] = normal.z;
}
// Sixteen vertices of row j, from column i on, moved to where the ray is the z axis.
static inline void sheared_row(const PatchTree* tree, const Query* q, uint i, uint j, float16* x,
                               float16* y) {
  // As patch_vertex().
  __global const Patch* p = tree->patch;
  const int level = (int)tree->level, n = 1 << level, shift = (int)p->level - level;
  const int16 lanes = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  int16 vi = min((int)i + lanes, n), vj = (int)j;
  if (tree->edges != tree->level * 0x01010101u) {
#define SNAP(x, k)                                                 \
  ((x + ((1 << (level - (int)edge_level(tree->edges, k))) >> 1)) & \
   ~((1 << (level - (int)edge_level(tree->edges, k))) - 1))
    vi = select(vi, SNAP(vi, 0), vj == 0);
    vj = select(vj, SNAP(vj, 1), vi == n);
    vi = select(vi, SNAP(vi, 2), vj == n);
    vj = select(vj, SNAP(vj, 3), vi == 0);
#undef SNAP
  }
  const float16 s = convert_float16(vi) / (float)n, t = convert_float16(vj) / (float)n;
  const float16 s1 = 1.0f - s, t1 = 1.0f - t;
  const int16 texel = ((vj << shift) * (int)p->row + (vi << shift)) * 3;
  __global const float* first = tree->map + 3 * (size_t)p->texels;
  float place[3][16];
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 base = (p->corners[0][axis] * s1 + p->corners[1][axis] * s) * t1 +
                         (p->corners[3][axis] * s1 + p->corners[2][axis] * s) * t;
    vstore16(base + gather_floats16(first + axis, texel), 0, place[axis]);
  }
  const float16 z = vload16(0, place[q->kz]) - q->origin[q->kz];
  *x = (vload16(0, place[q->kx]) - q->origin[q->kx]) - q->sx * z;
  *y = (vload16(0, place[q->ky]) - q->origin[q->ky]) - q->sy * z;
}

// Asks for what sheared_row() reads.
static inline void ask_for_row(const PatchTree* tree, uint i, uint j) {
  __global const Patch* p = tree->patch;
  const uint shift = p->level - tree->level;
  ASK(tree->map + 3 * ((size_t)p->texels + (j << shift) * p->row + (i << shift)), 192u << shift);
}

// Whether the ray goes through a triangle or along its edge, by the signed areas between it and the edges; as
// bits.
static inline uint inside(float16 ab, float16 bc, float16 ca) {
  return lane_bits16(
      ~(((ab < 0.0f) | (bc < 0.0f) | (ca < 0.0f)) & ((ab > 0.0f) | (bc > 0.0f) | (ca > 0.0f))));
}

// A ray and a patch that is not built, of level 4 or more: the micro-quads of those parts that the ray meets,
// row by row, each row's vertices made on the way. Cheaper than building for few rays, and in memory not at
// all. Returns micro-quads looked at.
static uint intersect_unbuilt(const PatchTree* tree, const Query* q, uint parts, float16 parts_entry,
                              uint any, PatchFound* found) {
  const uint part_side = 1u << (tree->level - 2);
  float t[16];
  vstore16(parts_entry, 0, t);
  uint visited = 0;
  while (parts != 0) {  // nearest first
    uint part = lowest_bit(parts);
    for (uint rest = parts & (parts - 1); rest != 0; rest &= rest - 1)
      if (t[lowest_bit(rest)] < t[part]) part = lowest_bit(rest);
    parts &= ~(1u << part);
    if (t[part] > found->t) break;
    const uint left = even_bits(part) * part_side, top = even_bits(part >> 1) * part_side;
    for (uint i = left; i < left + part_side; i += 15) {
      const uint quads = min(15u, left + part_side - i);
      float16 x0, y0, x1, y1;
      sheared_row(tree, q, i, top, &x0, &y0);
      for (uint j = top; j < top + part_side; ++j) {
        ask_for_row(tree, i, min(j + 6, top + part_side));  // rows are far from each other, too
        sheared_row(tree, q, i, j + 1, &x1, &y1);
        // Lane k: the side from vertex k to k + 1, the one up from vertex k, and the diagonal.
        const uint16 shifted = (uint16)(1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 15);
        const float16 bx = shuffle(x0, shifted), by = shuffle(y0, shifted), cx = shuffle(x1, shifted),
                      cy = shuffle(y1, shifted);
        const float16 ab = x0 * by - y0 * bx, bc = bx * cy - by * cx, cd = cx * y1 - cy * x1,
                      da = x1 * y0 - y1 * x0, ac = x0 * cy - y0 * cx;
        uint near = (inside(ab, bc, -ac) | inside(ac, cd, da)) & ((1u << quads) - 1);
        visited += quads;
        for (; near != 0; near &= near - 1) {
          const uint column = i + lowest_bit(near);
          if (intersect_micro_quad(tree, morton_of(column, j), q, found) && any) return visited;
        }
        x0 = x1;
        y0 = y1;
      }
    }
  }
  return visited;
}

// The box of a node as a hit.
static inline void take_box(__global const PatchBlock* block, uint lane, float t, PatchFound* found) {
  const uint n = block->normals[lane], uv = block->uvs[lane];
  found->t = t;
  found->u = (float)(uv & 0xffff) / 65535.0f;
  found->v = (float)(uv >> 16) / 65535.0f;
  found->normal[0] = (float)((int)(n << 21) >> 21) / 1023.0f;
  found->normal[1] = (float)((int)(n << 10) >> 21) / 1023.0f;
  found->normal[2] = (float)((int)n >> 22) / 511.0f;
  found->hit = FOUND_BOX;
}

#ifdef WIDE
// What is to be visited: a block's place, the level of its nodes, and which quarters of it as bits (0: all).
#define VISIT(at, level, quarters) ((at) + ((level) << 24) + ((quarters) << 28))

// Each of four bits four times.
static inline uint four_times(uint bits) {
  bits = (bits | bits << 6) & 0x303u;
  return ((bits | bits << 3) & 0x1111u) * 15u;
}

// The vertices of 16 micro-quads, axes in the order x y z of the ray's own space.
typedef struct Grid16 {
  GridAxis axes[3];
} Grid16;

// Of the finest level's b-th 16.
static inline void load_grid(const PatchTree* tree, uint b, const Query* q, Grid16* grid) {
  __global const float* from = tree->vertices + GRID_FLOATS * b;
  grid->axes[0] = load_grid_axis(from, q->kx);
  grid->axes[1] = load_grid_axis(from, q->ky);
  grid->axes[2] = load_grid_axis(from, q->kz);
}

// The finest level's b-th 16 micro-quads: by the arithmetic of intersect_micro_quad(), which is left what
// float cannot tell. Returns how many were met, one after the other as it were.
static ALWAYS_INLINE uint intersect_grid(const PatchTree* tree, uint b, const Grid16* grid, const Query* q,
                                         uint any, PatchFound* found) {
  const GridAxis gx = grid->axes[0], gy = grid->axes[1], gz = grid->axes[2];
  const float16 z0 = gz.first - q->origin[q->kz], z1 = gz.second - q->origin[q->kz];
  const float16 x0 = (gx.first - q->origin[q->kx]) - q->sx * z0,
                x1 = (gx.second - q->origin[q->kx]) - q->sx * z1;
  const float16 y0 = (gy.first - q->origin[q->ky]) - q->sy * z0,
                y1 = (gy.second - q->origin[q->ky]) - q->sy * z1;
  const float16 ax = GRID_A(x0, x1), ay = GRID_A(y0, y1), bx = GRID_B(x0, x1), by = GRID_B(y0, y1);
  const float16 cx = GRID_C(x0, x1), cy = GRID_C(y0, y1), dx = GRID_D(x0, x1), dy = GRID_D(y0, y1);
  const float16 ab = ax * by - ay * bx, bc = bx * cy - by * cx, cd = cx * dy - cy * dx,
                da = dx * ay - dy * ax, ac = ax * cy - ay * cx;
  const uint in_abc = inside(ab, bc, -ac), in_acd = inside(ac, cd, da);
  uint near = in_abc | in_acd;
  if (near == 0) return 0;
  if (near & lane_bits16((ab == 0.0f) | (bc == 0.0f) | (cd == 0.0f) | (da == 0.0f) | (ac == 0.0f))) {
    uint met = 0;
    for (; near != 0; near &= near - 1) {
      ++met;
      if (intersect_micro_quad(tree, PATCH_WIDTH * b + lowest_bit(near), q, found) && any) break;
    }
    return met;
  }
  const float16 tz0 = q->sz * z0, tz1 = q->sz * z1;
  const float16 az = GRID_A(tz0, tz1), bz = GRID_B(tz0, tz1), cz = GRID_C(tz0, tz1), dz = GRID_D(tz0, tz1);
  const float16 area_abc = -bc + ac + -ab, area_acd = -cd + -da + -ac;
  const float16 t_abc = (-bc * az + ac * bz + -ab * cz) / area_abc,
                t_acd = (-cd * az + -da * cz + -ac * dz) / area_acd;
  const float16 limit = found->t;
  uint hit_abc = in_abc & lane_bits16((t_abc >= q->tmin) & (t_abc < limit)),
       hit_acd = in_acd & lane_bits16((t_acd >= q->tmin) & (t_acd < limit));
  if (!found->hit) {
    hit_abc |= in_abc & lane_bits16((t_abc >= q->tmin) & (t_abc == limit));
    hit_acd |= in_acd & lane_bits16((t_acd >= q->tmin) & (t_acd == limit));
  }
  uint hits = hit_abc | hit_acd;
  if (hits == 0) return popcount(near);
  float ts[2][16];
  vstore16(t_abc, 0, ts[0]);
  vstore16(t_acd, 0, ts[1]);
  uint lane = 0, second = 0;
  float t = INFINITY;
  if (any) {
    near &= hits ^ (hits - 1);
    hits &= 0u - hits;
  }
  for (; hits != 0; hits &= hits - 1) {
    const uint at = lowest_bit(hits);
    if (hit_abc >> at & 1 && ts[0][at] < t) {
      t = ts[0][at];
      lane = at;
      second = 0;
    }
    if (hit_acd >> at & 1 && ts[1][at] < t) {
      t = ts[1][at];
      lane = at;
      second = 1;
    }
  }
  float weights[3][16];
  vstore16(second ? -da : ac, 0, weights[0]);
  vstore16(second ? -ac : -ab, 0, weights[1]);
  vstore16(second ? area_acd : area_abc, 0, weights[2]);
  found->t = t;
  found->u = weights[0][lane] / weights[2][lane];
  found->v = weights[1][lane] / weights[2][lane];
  found->hit = FOUND_TRIANGLE + second;
  found->at = PATCH_WIDTH * b + lane;
  return popcount(near);
}

// As intersect_grid().
static ALWAYS_INLINE uint intersect_leaves(const PatchTree* tree, uint b, const Query* q, uint any,
                                           PatchFound* found) {
  Grid16 grid;
  load_grid(tree, b, q, &grid);
  return intersect_grid(tree, b, &grid, q, any, found);
}

// What a ray will soon read is far away: several blocks are asked for at once.
static inline void ask_for(__global const PatchBlock* blocks, uint first, uint mask) {
  for (; mask != 0; mask &= mask - 1) ASK(blocks + first + lowest_bit(mask), sizeof(PatchBlock));
}

// Where to begin in a patch of level 2 or more, of whose 16 parts `parts` are met; 0: nowhere.
static inline uint first_visit(const PatchTree* tree, uint loose, uint parts, float16 parts_entry,
                               uint* stack, float* stack_t, uint* depth) {
  const uint level = tree->level;
  if (parts == 0) return 0;
  if (loose || level < 4) return level & 1 ? VISIT(0u, 1u, 8u) : VISIT(1u, 2u, 0u);
  if (!(level & 1)) {
    ask_for(tree->blocks, 6, parts);
    return take_children(0, VISIT(6u, 4u, 0u), parts, parts_entry, stack, stack_t, depth);
  }
  // A part's children are a quarter of a block, four parts' a block.
  float t[16];
  vstore16(parts_entry, 0, t);
  for (uint k = 0; k < 4; ++k) {
    const uint quarters = parts >> 4 * k & 15;
    if (quarters == 0) continue;
    ask_for(tree->blocks, 2 + k, 1);
    float first_t = INFINITY;
    for (uint rest = quarters; rest != 0; rest &= rest - 1)
      first_t = min(first_t, t[4 * k + lowest_bit(rest)]);
    uint at = (*depth)++;
    for (; at > 0 && stack_t[at - 1] < first_t; --at) {
      stack[at] = stack[at - 1];
      stack_t[at] = stack_t[at - 1];
    }
    stack[at] = VISIT(2 + k, 3u, quarters);
    stack_t[at] = first_t;
  }
  return stack[--*depth];
}

// What follows a visit of `current`; 0: nothing does.
static ALWAYS_INLINE uint visit_patch(const PatchTree* tree, uint current, const Query* q,
                                      const PatchRay* ray, uint any, uint* stack, float* stack_t, uint* depth,
                                      PatchFound* found, uint* visited) {
  ++*visited;
  const uint at = current & 0xffffff, at_level = current >> 24 & 15, quarters = current >> 28;
  uint next = 0;
  if (at_level == tree->level) {
    *visited += intersect_leaves(tree, at - block_count(tree->level), q, any, found);
    if (any && found->hit > FOUND_BEFORE) return 0;
  } else {
    __global const PatchBlock* block = tree->blocks + at;
    float16 entry;
    uint mask = intersect_planes16(block->planes, q, ray, found->t, &entry);
    if (quarters != 0) mask &= four_times(quarters);
    if (mask != 0 && at_level >= tree->wanted) {
      // The surface is no finer than these boxes; but what the ray starts in, it does not hit.
      const uint outside = mask & lane_bits16(entry > q->tmin);
      if (outside != 0) {
        float t[16];
        vstore16(entry, 0, t);
        uint lane = lowest_bit(outside);
        for (uint rest = outside & (outside - 1); rest != 0; rest &= rest - 1)
          if (t[lowest_bit(rest)] < t[lane]) lane = lowest_bit(rest);
        if (t[lane] < found->t) take_box(block, lane, t[lane], found);
        if (any) return 0;
        mask &= ~outside;
      }
    }
    if (mask != 0) {
      const uint first = PATCH_WIDTH * at - PATCH_FIRST_LANE;  // lane 0's node
      ask_for(tree->blocks, first + 1, mask);
      next = take_children(0, VISIT(first + 1, at_level + 2, 0u), mask, entry, stack, stack_t, depth);
    }
  }
  return next != 0 ? next : pop_nearer(stack, stack_t, depth, found->t);
}

// Micro-quads of a patch of a level below 2. Returns how many.
static inline uint intersect_few_leaves(const PatchTree* tree, const Query* q, PatchFound* found) {
  const uint count = 1u << 2 * tree->level;
  for (uint m = 0; m < count; ++m) intersect_micro_quad(tree, m, q, found);
  return count;
}

// Nearest hit, or any. `parts` and `parts_entry`: which of the patch's 16 parts the ray meets, and where.
// Returns blocks and micro-quads visited.
static uint traverse_patch(const PatchTree* tree, __global const Patch* p, __global const uint* links,
                           const Query* q, const PatchRay* ray, uint parts, float16 parts_entry, uint any,
                           PatchFound* found) {
  if (tree->level < 2) return intersect_few_leaves(tree, q, found);
  uint stack[PATCH_STACK], depth = 0, visited = 0;
  float stack_t[PATCH_STACK];
  uint current = first_visit(tree, p->loose, parts, parts_entry, stack, stack_t, &depth);
  while (current != 0)
    current = visit_patch(tree, current, q, ray, any, stack, stack_t, &depth, found, &visited);
  return visited;
}
#else
#define LINK_END 0xffffu

static inline uint child_link(__global const uint* links, uint deep, uint node) {
  return deep ? 4 * node + 1 : links[node] >> 16;
}
static inline uint skip_link(__global const uint* links, uint deep, uint node) {
  if (!deep) return links[node] & 0xffff;
  while (node != 0 && node % 4 == 0) node = (node - 1) / 4;
  return node == 0 ? 0xffffffffu : node + 1;
}

static uint traverse_patch(const PatchTree* tree, __global const Patch* p, __global const uint* links,
                           const Query* q, const PatchRay* ray, uint parts, float16 parts_entry, uint any,
                           PatchFound* found) {
  if (parts == 0) return 0;
  const uint leaves = first_node(tree->level), boxes = first_node(tree->wanted);
  const uint deep = tree->level > PATCH_LINKED_LEVEL, end = deep ? 0xffffffffu : LINK_END;
  uint node = 0, visited = 0;
  while (node != end) {
    ++visited;
    const uint at = node + PATCH_FIRST_LANE, lane = at % PATCH_WIDTH;
    __global const PatchBlock* block = tree->blocks + at / PATCH_WIDTH;
    float enter = q->tmin, leave = found->t;
    for (uint axis = 0; axis < 3; ++axis) {
      enter =
          max(enter, mad((float)block->planes[q->near_row[axis]][lane], ray->scale[axis], ray->near[axis]));
      leave = min(leave, mad((float)block->planes[q->far_row[axis]][lane], ray->scale[axis], ray->far[axis]));
    }
    if (!(enter <= leave)) {
      node = skip_link(links, deep, node);
    } else if (node >= leaves) {
      if (intersect_micro_quad(tree, node - leaves, q, found) && any) return visited;
      node = skip_link(links, deep, node);
    } else if (node >= boxes && enter > q->tmin) {
      if (enter < found->t) take_box(block, lane, enter, found);
      if (any) return visited;
      node = skip_link(links, deep, node);
    } else {
      node = child_link(links, deep, node);
    }
  }
  return visited;
}
#endif
#endif
