// The leaves of a patch's hierarchy: a ray intersects a micro-quad as two triangles, by the arithmetic of the
// watertight triangle test (kernels/bvh), so that hits equal those of the tessellated mesh bit for bit. WIDE:
// 16 micro-quads at once. Boxes only cull; traverse_patch.h leads from a patch's box to its micro-quads.
#ifndef RBVH_MICRO_QUAD_H
#define RBVH_MICRO_QUAD_H
#include "kernels/bvh/prepared_ray.h"
#include "kernels/trace/patch_surface.h"
#include "kernels/bvh/wide_node.h"

// The nearest hit so far.
typedef struct PatchFound {
  float t;
  float u, v;       // in the patch, 0..1
  float normal[3];  // of the object's space, any length
  uint hit;         // FOUND_*; from FOUND_TRIANGLE on the micro-quad's first or second triangle
  uint at;          // the micro-quad
} PatchFound;

#define FOUND_NOTHING 0
#define FOUND_BEFORE 1  // something else, at t
#define FOUND_BOX 2
#define FOUND_TRIANGLE 3  // u and v are still barycentric, see finish_found()

typedef struct PatchTree {
  __global const PatchBlock* blocks;
  __global const float* vertices;  // x y z, row by row, or grids; null where the patch is not built
  uint level;
  uint wanted;  // the level that the ray resolves; at most `level`
  // Where the patch is not built: what its vertices are computed from.
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

static inline PatchRay patch_ray(__global const Patch* p, const PreparedRay* q) {
  PatchRay r;
  for (uint axis = 0; axis < 3; ++axis) {
    const float lo = p->lo[axis];
    r.scale[axis] = (p->hi[axis] - lo) * (1.0f / 65535.0f) * q->inverse[axis];
    r.near[axis] = lo * q->inverse[axis] + q->near_offset[axis];
    r.far[axis] = lo * q->inverse[axis] + q->far_offset[axis];
  }
  return r;
}

// intersect_children() for 16 boxes in quanta.
static ALWAYS_INLINE uint intersect_planes16(__global const ushort (*planes)[PATCH_WIDTH],
                                             const PreparedRay* q, const PatchRay* r, float limit,
                                             float16* entry) {
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

// From the world's t to an object's lengths, for a ray whose direction there is `speed` long.
static inline RayDetail detail_of(RayDetail detail, float speed) {
  const RayDetail scaled = {detail.width * speed, detail.spread * speed};
  return scaled;
}

// The level whose micro-quads are about as long as what the ray resolves at t; at most `most`.
static inline uint wanted_level(__global const Patch* p, RayDetail detail, float t, uint most) {
  const float resolved = detail.width + detail.spread * max(t, 0.0f);
  const float pieces = p->size / resolved * 0.70710678f;  // the nearest power of two
  if (!(pieces < (float)(1u << PATCH_MOST_LEVEL))) return most;
  return pieces <= 1.0f ? 0u : min(most, ((as_uint(pieces) - 1) >> 23) - 126);
}

// Micro-quad m's corners a b c d, one row an axis.
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
static inline bool intersect_micro_quad(const PatchTree* tree, uint m, const PreparedRay* q,
                                        PatchFound* found) {
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

// From barycentric coordinates in the hit triangle to u, v in the patch, and the triangle's normal.
static inline void finish_found(const PatchTree* tree, PatchFound* found) {
  if (found->hit < FOUND_TRIANGLE) return;
  const uint n = 1u << tree->level, second = found->hit - FOUND_TRIANGLE;
  const uint i = even_bits(found->at), j = even_bits(found->at >> 1);
  float4 corners[3];
  load_corners(tree, found->at, corners);
  const float v = found->u, w = found->v;
  // Rounding can make the sum of two weights exceed one.
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

// Lanes whose triangle the ray intersects, edges included, by the signed areas between the ray and the edges;
// as bits.
static inline uint inside(float16 ab, float16 bc, float16 ca) {
  return lane_bits16(
      ~(((ab < 0.0f) | (bc < 0.0f) | (ca < 0.0f)) & ((ab > 0.0f) | (bc > 0.0f) | (ca > 0.0f))));
}

#ifdef WIDE
// The vertices of 16 micro-quads, axes in the order x y z of the ray's own space.
typedef struct Grid16 {
  GridAxis axes[3];
} Grid16;

// The finest level's b-th 16 micro-quads.
static inline void load_grid(const PatchTree* tree, uint b, const PreparedRay* q, Grid16* grid) {
  __global const float* from = tree->vertices + GRID_FLOATS * b;
  grid->axes[0] = load_grid_axis(from, q->kx);
  grid->axes[1] = load_grid_axis(from, q->ky);
  grid->axes[2] = load_grid_axis(from, q->kz);
}

// Intersects the finest level's b-th 16 micro-quads by the arithmetic of intersect_micro_quad(), which takes
// over where float32 does not decide a sign. Returns how many a scalar loop would have intersected.
static ALWAYS_INLINE uint intersect_grid(const PatchTree* tree, uint b, const Grid16* grid,
                                         const PreparedRay* q, uint any, PatchFound* found) {
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
    uint tested = 0;
    for (; near != 0; near &= near - 1) {
      ++tested;
      if (intersect_micro_quad(tree, PATCH_WIDTH * b + lowest_bit(near), q, found) && any) break;
    }
    return tested;
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

// The same, with the vertices loaded.
static ALWAYS_INLINE uint intersect_leaves(const PatchTree* tree, uint b, const PreparedRay* q, uint any,
                                           PatchFound* found) {
  Grid16 grid;
  load_grid(tree, b, q, &grid);
  return intersect_grid(tree, b, &grid, q, any, found);
}

#endif
#endif
