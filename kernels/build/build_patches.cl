// Bounds of displaced patches, and their hierarchies: after Harada, "Rendering Vector Displacement Mapped
// Surfaces in a GPU Ray Tracer", GPU Pro 6, listing 1.2. Levels are built bottom-up: displaced vertices, the
// micro-quads' boxes, then each level from the one below.
//
// GROUP work-items share a patch; groups take patches from a queue until none is left. WIDE (a CPU): a group
// is one work-item that builds 16 nodes at once.
#include "kernels/trace/patch_surface.h"
#include "kernels/common/work_queue.h"

// --- bounds: one patch a work-item

// From box to quanta, with a margin of a twentieth of a quantum on both sides: far more than rounding errors.
static inline void quantise(float3 lo, float3 hi, float3 root_lo, float3 per_quantum, float3* q_lo,
                            float3* q_hi) {
  *q_lo = clamp(floor((lo - root_lo) * per_quantum - 0.05f), 0.0f, 65535.0f);
  *q_hi = clamp(ceil((hi - root_lo) * per_quantum + 0.05f), 0.0f, 65535.0f);
}

__kernel void bound_patches(__global Patch* patches, uint count, __global const float* map,
                            __global PatchParts* parts) {
  const uint at = (uint)get_global_id(0);
  if (at >= count) return;
  __global Patch* p = patches + at;
  const uint level = p->level, n = 1u << level, edges = level * 0x01010101u;
  float3 lo[PATCH_WIDTH], hi[PATCH_WIDTH];
  float3 root_lo = FLT_MAX, root_hi = -FLT_MAX;
  for (uint part = 0; part < PATCH_WIDTH; ++part) {
    const uint x = even_bits(part), y = even_bits(part >> 1);
    float3 a = FLT_MAX, b = -FLT_MAX;
    for (uint j = y * n / 4; j <= ((y + 1) * n + 3) / 4; ++j) {
      for (uint i = x * n / 4; i <= ((x + 1) * n + 3) / 4; ++i) {
        const float3 v = patch_vertex(p, map, level, edges, i, j);
        a = min(a, v);
        b = max(b, v);
      }
    }
    lo[part] = a;
    hi[part] = b;
    root_lo = min(root_lo, a);
    root_hi = max(root_hi, b);
  }
  // The length of micro-quads' sides, from a sample of them at the finest level.
  float squares_u = 0.0f, squares_v = 0.0f, samples = 0.0f;
  const uint stride = max(n / 16, 1u);
  for (uint j = stride / 2; j < n; j += stride) {
    for (uint i = stride / 2; i < n; i += stride) {
      const float3 v = patch_vertex(p, map, level, edges, i, j);
      const float3 u_side = patch_vertex(p, map, level, edges, i + 1, j) - v;
      const float3 v_side = patch_vertex(p, map, level, edges, i, j + 1) - v;
      squares_u += dot(u_side, u_side);
      squares_v += dot(v_side, v_side);
      samples += 1.0f;
    }
  }
  p->size = (float)n * sqrt(max(squares_u, squares_v) / samples);
  // Never flat, and a little wider than the surface.
  const float3 extent = root_hi - root_lo, size = max(fabs(root_lo), fabs(root_hi));
  const float longest = max(max(extent.x, extent.y), max(extent.z, FLT_MIN));
  const float3 pad = max((float3)(1e-5f * longest), 2e-7f * size);
  root_lo -= pad;
  root_hi += pad;
  vstore3(root_lo, 0, p->lo);
  vstore3(root_hi, 0, p->hi);
  const float3 per_quantum = 65535.0f / (root_hi - root_lo);
  for (uint part = 0; part < PATCH_WIDTH; ++part) {
    float3 q_lo = 0.0f, q_hi = 65535.0f;
    if (!p->loose) quantise(lo[part], hi[part], root_lo, per_quantum, &q_lo, &q_hi);
    const float rows[6] = {q_lo.x, q_lo.y, q_lo.z, q_hi.x, q_hi.y, q_hi.z};
    for (uint row = 0; row < 6; ++row) parts[at].planes[row][part] = (ushort)rows[row];
  }
}

// --- hierarchies

static inline uint pack_normal(float3 n) {
  const int x = (int)rint(n.x * 1023.0f), y = (int)rint(n.y * 1023.0f), z = (int)rint(n.z * 511.0f);
  return ((uint)x & 0x7ff) | ((uint)y & 0x7ff) << 11 | (uint)z << 22;
}
static inline float3 unpack_normal(uint n) {
  return (float3)((float)((int)(n << 21) >> 21) / 1023.0f, (float)((int)(n << 10) >> 21) / 1023.0f,
                  (float)((int)n >> 22) / 511.0f);
}

#define VERTEX(i, j) vload3((j)*side + (i), vertices)

// One micro-quad's node.
static inline void build_leaf(__global PatchBlock* blocks, __global const float* vertices, uint level, uint m,
                              float3 root_lo, float3 per_quantum) {
  const uint n = 1u << level, side = n + 1, i = even_bits(m), j = even_bits(m >> 1);
  const float3 a = VERTEX(i, j), b = VERTEX(i + 1, j), c = VERTEX(i + 1, j + 1), d = VERTEX(i, j + 1);
  float3 lo, hi;
  quantise(min(min(a, b), min(c, d)), max(max(a, b), max(c, d)), root_lo, per_quantum, &lo, &hi);
  const uint at = first_node(level) + m + PATCH_FIRST_LANE, lane = at % PATCH_WIDTH;
  __global PatchBlock* block = blocks + at / PATCH_WIDTH;
  const float rows[6] = {lo.x, lo.y, lo.z, hi.x, hi.y, hi.z};
  for (uint row = 0; row < 6; ++row) block->planes[row][lane] = (ushort)rows[row];
  const float3 e = (c - a) * per_quantum.x,
               f = (d - b) * per_quantum.x;  // in quanta: their product does not vanish
  const float3 normal = cross(e, f);
  const float length2 = dot(normal, normal);
  block->normals[lane] = pack_normal(length2 > 0.0f ? normal * rsqrt(length2) : (float3)(0.0f));
  const float size = 65535.0f / (float)n;
  block->uvs[lane] = (uint)(((float)i + 0.5f) * size) | (uint)(((float)j + 0.5f) * size) << 16;
}

// A node from its four children, which are four neighbouring lanes of one block.
static inline void build_inner(__global PatchBlock* blocks, uint node) {
  const uint at = node + PATCH_FIRST_LANE, from = 4 * node + 1 + PATCH_FIRST_LANE;
  const uint lane = at % PATCH_WIDTH, first = from % PATCH_WIDTH;
  __global PatchBlock* block = blocks + at / PATCH_WIDTH;
  __global const PatchBlock* children = blocks + from / PATCH_WIDTH;
  for (uint row = 0; row < 6; ++row) {
    const ushort4 v = vload4(0, children->planes[row] + first);
    const ushort2 v2 = row < 3 ? min(v.lo, v.hi) : max(v.lo, v.hi);
    block->planes[row][lane] = row < 3 ? min(v2.x, v2.y) : max(v2.x, v2.y);
  }
  float3 normal = 0.0f;
  uint u = 0, v = 0;
  for (uint c = 0; c < 4; ++c) {
    normal += unpack_normal(children->normals[first + c]) * 0.25f;
    u += children->uvs[first + c] & 0xffff;
    v += children->uvs[first + c] >> 16;
  }
  block->normals[lane] = pack_normal(normal);
  block->uvs[lane] = u / 4 | (v / 4) << 16;
}

#ifdef WIDE
// The patch's corners, repeated as in a row of vertices x y z x y z ..., 16 floats.
typedef struct RowMaker {
  float16 corners[4];
} RowMaker;

static inline RowMaker row_maker(__global const Patch* p) {
  RowMaker maker;
  for (uint k = 0; k < 4; ++k) {
    const float x = p->corners[k][0], y = p->corners[k][1], z = p->corners[k][2];
    maker.corners[k] = (float16)(x, y, z, x, y, z, x, y, z, x, y, z, x, y, z, x);
  }
  return maker;
}

// Five vertices of row j from column i on, as patch_vertex() makes them inside the patch, and a float more.
static inline float16 make_row(const RowMaker* maker, __global const Patch* p, __global const float* map,
                               uint level, uint i, uint j) {
  const uint shift = p->level - level;
  const float inverse_n = 1.0f / (float)(1u << level);
  const float16 column = (float16)(0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4, 5);
  const float16 s = ((float)i + column) * inverse_n, s1 = 1.0f - s;
  const float t = (float)j * inverse_n, t1 = 1.0f - t;
  const float16* corners = maker->corners;
  const float16 base = (corners[0] * s1 + corners[1] * s) * t1 + (corners[3] * s1 + corners[2] * s) * t;
  __global const float* row = map + 3 * ((size_t)p->texels + (size_t)(j << shift) * p->row + (i << shift));
  if (shift == 0) return base + vload16(0, row);
  const uint step = 3u << shift;
  const float3 a = vload3(0, row), b = vload3(0, row + step), c = vload3(0, row + 2 * step),
               d = vload3(0, row + 3 * step), e = vload3(0, row + 4 * step);
  return base + (float16)(a, b, c, d, e, 0.0f);
}

// 16 nodes in registers.
typedef struct Nodes16 {
  ushort16 planes[6];
  int16 x, y, z;  // normals
  uint16 u, v;
} Nodes16;

static inline Nodes16 load_nodes16(__global const PatchBlock* block) {
  Nodes16 nodes;
  for (uint row = 0; row < 6; ++row) nodes.planes[row] = vload16(0, block->planes[row]);
  const int16 n = as_int16(vload16(0, block->normals));
  nodes.x = (n << 21) >> 21;
  nodes.y = (n << 10) >> 21;
  nodes.z = n >> 22;
  const uint16 uv = vload16(0, block->uvs);
  nodes.u = uv & 0xffff;
  nodes.v = uv >> 16;
  return nodes;
}

// The b-th 16 micro-quads: their vertices go to `grid`.
static inline Nodes16 build_leaves16(const RowMaker* maker, __global const Patch* p,
                                     __global const float* map, uint level, uint edges, uint b,
                                     const float* root_lo, const float* per_quantum, __global float* grid) {
  Nodes16 nodes;
  const uint n = 1u << level, i = 4 * even_bits(b), j = 4 * even_bits(b >> 1);
  float16 rows[5];
#pragma unroll
  for (uint row = 0; row < 5; ++row) rows[row] = make_row(maker, p, map, level, i, j + row);
  GridAxis axes[3];
#define GRID_ROWS(r, X, X0, X4)                                                             \
  {                                                                                         \
    (float16)((r)[0].X, (r)[0].X4, (r)[1].X, (r)[1].X4, (r)[2].X, (r)[2].X4, (r)[3].X0),    \
        (float16)((r)[1].X4, (r)[2].X, (r)[2].X4, (r)[3].X, (r)[3].X4, (r)[4].X, (r)[4].X4) \
  }
  const GridAxis x_axis = GRID_ROWS(rows, s0369, s0, sc), y_axis = GRID_ROWS(rows, s147a, s1, sd),
                 z_axis = GRID_ROWS(rows, s258b, s2, se);
#undef GRID_ROWS
  axes[0] = x_axis;
  axes[1] = y_axis;
  axes[2] = z_axis;
  for (uint axis = 0; axis < 3; ++axis) {
    vstore16(axes[axis].first, 0, grid + GRID_AXIS * axis);
    vstore16(axes[axis].second, 0, grid + GRID_AXIS * axis + 9);
  }
  if (edges != level * 0x01010101u &&
      (i == 0 || j == 0 || i + 4 == n || j + 4 == n)) {  // borders may be coarser
    for (uint k = 0; k < 25; ++k) {
      const uint vi = i + k % 5, vj = j + k / 5;
      if (vi != 0 && vj != 0 && vi != n && vj != n) continue;
      const float3 v = patch_vertex(p, map, level, edges, vi, vj);
      grid[k] = v.x;
      grid[GRID_AXIS + k] = v.y;
      grid[2 * GRID_AXIS + k] = v.z;
    }
    for (uint axis = 0; axis < 3; ++axis) axes[axis] = load_grid_axis(grid, axis);
  }
  float16 e[3], f[3];
#pragma unroll
  for (uint axis = 0; axis < 3; ++axis) {
    const float16 first = axes[axis].first, second = axes[axis].second;
    const float16 p00 = GRID_A(first, second), p10 = GRID_B(first, second), p11 = GRID_C(first, second),
                  p01 = GRID_D(first, second);
    const float16 lo = min(min(p00, p10), min(p01, p11)), hi = max(max(p00, p10), max(p01, p11));
    const float16 q_lo = clamp(floor((lo - root_lo[axis]) * per_quantum[axis] - 0.05f), 0.0f, 65535.0f);
    const float16 q_hi = clamp(ceil((hi - root_lo[axis]) * per_quantum[axis] + 0.05f), 0.0f, 65535.0f);
    nodes.planes[axis] = convert_ushort16(q_lo);
    nodes.planes[axis + 3] = convert_ushort16(q_hi);
    e[axis] = (p11 - p00) * per_quantum[0];
    f[axis] = (p01 - p10) * per_quantum[0];
  }
  const float16 x = e[1] * f[2] - e[2] * f[1], y = e[2] * f[0] - e[0] * f[2], z = e[0] * f[1] - e[1] * f[0];
  const float16 length2 = x * x + y * y + z * z;
  const float16 scale = select((float16)(0.0f), rsqrt(length2), length2 > 0.0f);
  nodes.x = convert_int16(rint(x * scale * 1023.0f));
  nodes.y = convert_int16(rint(y * scale * 1023.0f));
  nodes.z = convert_int16(rint(z * scale * 511.0f));
  const float16 u = (float16)(0, 1, 0, 1, 2, 3, 2, 3, 0, 1, 0, 1, 2, 3, 2, 3);
  const float16 v = (float16)(0, 0, 1, 1, 0, 0, 1, 1, 2, 2, 3, 3, 2, 2, 3, 3);
  const float size = 65535.0f / (float)n;
  nodes.u = convert_uint16((u + ((float)i + 0.5f)) * size);
  nodes.v = convert_uint16((v + ((float)j + 0.5f)) * size);
  return nodes;
}

#define SUM4(v) ((v).even.even + (v).even.odd + (v).odd.even + (v).odd.odd)

// The four parents of 16 nodes.
static inline void build_parents4(const Nodes16* nodes, __global PatchBlock* block, uint lane) {
#pragma unroll
  for (uint row = 0; row < 6; ++row) {
    const ushort16 c = nodes->planes[row];
    const ushort8 c8 = row < 3 ? min(c.even, c.odd) : max(c.even, c.odd);
    vstore4(row < 3 ? min(c8.even, c8.odd) : max(c8.even, c8.odd), 0, block->planes[row] + lane);
  }
  const int4 x = (SUM4(nodes->x) + 2) >> 2, y = (SUM4(nodes->y) + 2) >> 2, z = (SUM4(nodes->z) + 2) >> 2;
  vstore4(as_uint4((x & 0x7ff) | (y & 0x7ff) << 11 | z << 22), 0, block->normals + lane);
  vstore4(SUM4(nodes->u) >> 2 | SUM4(nodes->v) >> 2 << 16, 0, block->uvs + lane);
}
#endif

static inline void build_patch(__global const Patch* p, __global const float* map, const PatchBuild build,
                               __global PatchBlock* blocks) {
  const uint level = build.level, n = 1u << level, side = n + 1, count = side * side;
  __global float* vertices = (__global float*)slot_vertices(blocks, level);
  const float3 root_lo = vload3(0, p->lo), per_quantum = 65535.0f / (vload3(0, p->hi) - root_lo);
#ifdef WIDE
  if (level < 2) {
    for (uint v = 0; v < count; ++v)
      vstore3(patch_vertex(p, map, level, build.edges, v % side, v / side), v, vertices);
    for (uint m = 0; m < n * n; ++m) build_leaf(blocks, vertices, level, m, root_lo, per_quantum);
  } else {
    const float lo[3] = {root_lo.x, root_lo.y, root_lo.z};
    const float scale[3] = {per_quantum.x, per_quantum.y, per_quantum.z};
    const RowMaker maker = row_maker(p);
    for (uint l = level - 1; l >= 1; --l) {
      const uint first = first_node(l) + PATCH_FIRST_LANE;
      __global const PatchBlock* below = blocks + (first_node(l + 1) + PATCH_FIRST_LANE) / PATCH_WIDTH;
      for (uint b = 0; b < 1u << 2 * (l - 1); ++b) {
        const Nodes16 nodes = l + 1 == level ? build_leaves16(&maker, p, map, level, build.edges, b, lo,
                                                              scale, vertices + GRID_FLOATS * b)
                                             : load_nodes16(below + b);
        const uint at = first + 4 * b;
        build_parents4(&nodes, blocks + at / PATCH_WIDTH, at % PATCH_WIDTH);
      }
    }
  }
  if (level > 0) build_inner(blocks, 0);
#else
  const uint id = (uint)get_local_id(0);
  for (uint v = id; v < count; v += GROUP) {
    const float3 place = patch_vertex(p, map, level, build.edges, v % side, v / side);
    vstore3(place, v, vertices);
  }
  GROUP_BARRIER;
  for (uint m = id; m < n * n; m += GROUP) build_leaf(blocks, vertices, level, m, root_lo, per_quantum);
  GROUP_BARRIER;
  for (int l = (int)level - 1; l >= 0; --l) {
    const uint first = first_node((uint)l), nodes = 1u << 2 * l;
    for (uint k = id; k < nodes; k += GROUP) build_inner(blocks, first + k);
    GROUP_BARRIER;
  }
#endif
}

__kernel void build_patches(__global const Patch* patches, __global const float* map,
                            __global const PatchBuild* builds, uint count, __global uint* queue,
                            __global PatchBlock* cache) {
  TAKE_FROM_QUEUE(queue, count,
                  build_patch(patches + builds[at].patch, map, builds[at], cache + builds[at].at));
}
