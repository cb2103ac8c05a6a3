// Bounds of displaced patches, and their hierarchies: after Harada, "Rendering Vector Displacement Mapped Surfaces in a
// GPU Ray Tracer", GPU Pro 6, listing 1.2. Levels are built bottom-up: displaced vertices, the micro-quads' boxes,
// then each level from the one below.
//
// GROUP work-items share a patch; groups take patches from a queue until none is left. WIDE: a group is one work-item
// that builds 16 nodes at once (a CPU).
#include "patch_surface.h"

#if GROUP > 1
#define GROUP_BARRIER barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)
#else
#define GROUP_BARRIER
#endif

// --- bounds: one patch a work-item

// From box to quanta: rounding in here is far less than the twentieth of a quantum that is left on both sides.
static inline void quantise(float3 lo, float3 hi, float3 root_lo, float3 per_quantum, float3* q_lo, float3* q_hi) {
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

#define VERTEX(i, j) \
  (float3)(vertices[(j) * side + (i)], vertices[(j) * side + (i) + count], vertices[(j) * side + (i) + 2 * count])

// One micro-quad's node.
static inline void build_leaf(__global PatchBlock* blocks, __global const float* vertices, uint level, uint m,
                              float3 root_lo, float3 per_quantum) {
  const uint n = 1u << level, side = n + 1, count = side * side, i = even_bits(m), j = even_bits(m >> 1);
  const float3 a = VERTEX(i, j), b = VERTEX(i + 1, j), c = VERTEX(i + 1, j + 1), d = VERTEX(i, j + 1);
  float3 lo, hi;
  quantise(min(min(a, b), min(c, d)), max(max(a, b), max(c, d)), root_lo, per_quantum, &lo, &hi);
  const uint at = first_node(level) + m + PATCH_FIRST_LANE, lane = at % PATCH_WIDTH;
  __global PatchBlock* block = blocks + at / PATCH_WIDTH;
  const float rows[6] = {lo.x, lo.y, lo.z, hi.x, hi.y, hi.z};
  for (uint row = 0; row < 6; ++row) block->planes[row][lane] = (ushort)rows[row];
  const float3 e = (c - a) * per_quantum.x, f = (d - b) * per_quantum.x;  // in quanta: their product does not vanish
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
// Vertices 16 at a time.
static inline void build_vertices(__global const Patch* p, __global const float* map, uint level, uint edges,
                                  __global float* vertices) {
  const int n = 1 << level, side = n + 1, count = side * side;
  const uint shift = p->level - level;
  const float inverse_side = 1.0f / (float)side, inverse_n = 1.0f / (float)n;
  const int16 lanes = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  __global const float* first = map + 3 * (size_t)p->texels;
  const bool snaps = edges != level * 0x01010101u;
  for (int at = 0; at < count; at += 16) {
    const int16 v = min(at + lanes, count - 1);
    int16 j = convert_int16(convert_float16(v) * inverse_side), i = v - j * side;
    const int16 below = i < 0;  // j is a comparison's lanes away from right
    j += below;
    i -= below * side;
    const int16 above = i >= side;
    j -= above;
    i += above * side;
    if (snaps) {
#define SNAP(x, k) \
  ((x + ((1 << (level - edge_level(edges, k))) >> 1)) & ~((1 << (level - edge_level(edges, k))) - 1))
      i = select(i, SNAP(i, 0), j == 0);
      j = select(j, SNAP(j, 1), i == n);
      i = select(i, SNAP(i, 2), j == n);
      j = select(j, SNAP(j, 3), i == 0);
#undef SNAP
    }
    const float16 s = convert_float16(i) * inverse_n, t = convert_float16(j) * inverse_n;
    const float16 s1 = 1.0f - s, t1 = 1.0f - t;
    int texel[16];
    vstore16(((j << (int)shift) * (int)p->row + (i << (int)shift)) * 3, 0, texel);
    for (uint axis = 0; axis < 3; ++axis) {
      const float16 base = (p->corners[0][axis] * s1 + p->corners[1][axis] * s) * t1 +
                           (p->corners[3][axis] * s1 + p->corners[2][axis] * s) * t;
      float d[16];
      for (uint lane = 0; lane < 16; ++lane) d[lane] = first[texel[lane] + (int)axis];
      const float16 place = base + vload16(0, d);
      __global float* to = vertices + axis * (uint)count + (uint)at;
      if (at + 16 <= count) {
        vstore16(place, 0, to);
      } else {
        vstore16(place, 0, d);
        for (int lane = 0; at + lane < count; ++lane) to[lane] = d[lane];
      }
    }
  }
}

// Four rows of four numbers in the order of a Morton curve.
#define MORTON16(a, b, c, d) (float16)(a.lo, b.lo, a.hi, b.hi, c.lo, d.lo, c.hi, d.hi)

// 16 micro-quads: 5 x 5 vertices. `block` is the b-th of the finest level.
static inline void build_leaves16(__global PatchBlock* block, __global const float* vertices, uint level, uint b,
                                  const float* root_lo, const float* per_quantum) {
  const uint n = 1u << level, side = n + 1, count = side * side;
  const uint i = 4 * even_bits(b), j = 4 * even_bits(b >> 1);
  float16 e[3], f[3];
  for (uint axis = 0; axis < 3; ++axis) {
    __global const float* from = vertices + axis * count + j * side + i;
    float4 left[5], right[5];
    for (uint row = 0; row < 5; ++row) {
      left[row] = vload4(0, from + row * side);
      right[row] = vload4(0, from + row * side + 1);
    }
    const float16 p00 = MORTON16(left[0], left[1], left[2], left[3]);
    const float16 p10 = MORTON16(right[0], right[1], right[2], right[3]);
    const float16 p01 = MORTON16(left[1], left[2], left[3], left[4]);
    const float16 p11 = MORTON16(right[1], right[2], right[3], right[4]);
    const float16 lo = min(min(p00, p10), min(p01, p11)), hi = max(max(p00, p10), max(p01, p11));
    const float16 q_lo = clamp(floor((lo - root_lo[axis]) * per_quantum[axis] - 0.05f), 0.0f, 65535.0f);
    const float16 q_hi = clamp(ceil((hi - root_lo[axis]) * per_quantum[axis] + 0.05f), 0.0f, 65535.0f);
    vstore16(convert_ushort16(q_lo), 0, block->planes[axis]);
    vstore16(convert_ushort16(q_hi), 0, block->planes[axis + 3]);
    e[axis] = (p11 - p00) * per_quantum[0];
    f[axis] = (p01 - p10) * per_quantum[0];
  }
  const float16 x = e[1] * f[2] - e[2] * f[1], y = e[2] * f[0] - e[0] * f[2], z = e[0] * f[1] - e[1] * f[0];
  const float16 length2 = x * x + y * y + z * z;
  const float16 scale = select((float16)(0.0f), rsqrt(length2), length2 > 0.0f);
  const int16 px = convert_int16(rint(x * scale * 1023.0f)), py = convert_int16(rint(y * scale * 1023.0f)),
              pz = convert_int16(rint(z * scale * 511.0f));
  vstore16(as_uint16((px & 0x7ff) | (py & 0x7ff) << 11 | pz << 22), 0, block->normals);
  const float16 u = (float16)(0, 1, 0, 1, 2, 3, 2, 3, 0, 1, 0, 1, 2, 3, 2, 3);
  const float16 v = (float16)(0, 0, 1, 1, 0, 0, 1, 1, 2, 2, 3, 3, 2, 2, 3, 3);
  const float size = 65535.0f / (float)n;
  vstore16(convert_uint16((u + ((float)i + 0.5f)) * size) | convert_uint16((v + ((float)j + 0.5f)) * size) << 16, 0,
           block->uvs);
}

// 16 nodes from the four blocks of their children.
static inline void build_inner16(__global PatchBlock* blocks, uint at) {
  __global PatchBlock* block = blocks + at;
  __global const PatchBlock* from = blocks + (4 * at - 2);
  for (uint row = 0; row < 6; ++row) {
    ushort16 v = 0;
    ushort4 each[4];
    for (uint k = 0; k < 4; ++k) {
      const ushort16 c = vload16(0, from[k].planes[row]);
      const ushort8 c8 = row < 3 ? min(c.even, c.odd) : max(c.even, c.odd);
      each[k] = row < 3 ? min(c8.even, c8.odd) : max(c8.even, c8.odd);
    }
    v = (ushort16)(each[0], each[1], each[2], each[3]);
    vstore16(v, 0, block->planes[row]);
  }
  for (uint k = 0; k < 4; ++k) {
    const int16 n = as_int16(vload16(0, from[k].normals));
    const int16 x = (n << 21) >> 21, y = (n << 10) >> 21, z = n >> 22;
    const int8 x8 = x.even + x.odd, y8 = y.even + y.odd, z8 = z.even + z.odd;
    const int4 x4 = (x8.even + x8.odd + 2) >> 2, y4 = (y8.even + y8.odd + 2) >> 2, z4 = (z8.even + z8.odd + 2) >> 2;
    vstore4(as_uint4((x4 & 0x7ff) | (y4 & 0x7ff) << 11 | z4 << 22), 0, block->normals + 4 * k);
    const uint16 uv = vload16(0, from[k].uvs);
    const uint16 u = uv & 0xffff, v = uv >> 16;
    const uint8 u8 = u.even + u.odd, v8 = v.even + v.odd;
    vstore4(((u8.even + u8.odd) >> 2) | ((v8.even + v8.odd) >> 2) << 16, 0, block->uvs + 4 * k);
  }
}
#endif

static inline void build_patch(__global const Patch* p, __global const float* map, const PatchBuild build,
                               __global PatchBlock* blocks) {
  const uint level = build.level, n = 1u << level, side = n + 1, count = side * side;
  __global float* vertices = (__global float*)slot_vertices(blocks, level);
  const float3 root_lo = vload3(0, p->lo), per_quantum = 65535.0f / (vload3(0, p->hi) - root_lo);
  const uint id = (uint)get_local_id(0);
#ifdef WIDE
  build_vertices(p, map, level, build.edges, vertices);
  if (level >= 2) {
    const float lo[3] = {root_lo.x, root_lo.y, root_lo.z};
    const float scale[3] = {per_quantum.x, per_quantum.y, per_quantum.z};
    __global PatchBlock* finest = blocks + (first_node(level) + PATCH_FIRST_LANE) / PATCH_WIDTH;
    for (uint b = 0; b < n * n / PATCH_WIDTH; ++b) build_leaves16(finest + b, vertices, level, b, lo, scale);
  } else {
    for (uint m = 0; m < n * n; ++m) build_leaf(blocks, vertices, level, m, root_lo, per_quantum);
  }
  for (int l = (int)level - 1; l >= 0; --l) {
    if (l >= 2) {
      const uint first = (first_node((uint)l) + PATCH_FIRST_LANE) / PATCH_WIDTH;
      for (uint b = 0; b < (1u << 2 * l) / PATCH_WIDTH; ++b) build_inner16(blocks, first + b);
    } else {
      for (uint k = first_node((uint)l); k < first_node((uint)l + 1); ++k) build_inner(blocks, k);
    }
  }
#else
  for (uint v = id; v < count; v += GROUP) {
    const float3 place = patch_vertex(p, map, level, build.edges, v % side, v / side);
    vertices[v] = place.x;
    vertices[v + count] = place.y;
    vertices[v + 2 * count] = place.z;
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
#if GROUP > 1
  __local uint taken;
#endif
  while (true) {
#if GROUP > 1
    if (get_local_id(0) == 0) taken = atomic_inc(queue);
    GROUP_BARRIER;
    const uint at = taken;
    GROUP_BARRIER;
#else
    const uint at = atomic_inc(queue);
#endif
    if (at >= count) return;
    const PatchBuild build = builds[at];
    build_patch(patches + build.patch, map, build, cache + build.at);
  }
}
