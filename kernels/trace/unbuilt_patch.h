// A ray intersects a patch whose hierarchy is not built: cheaper than building it for few rays, and without
// its memory.
#ifndef RBVH_UNBUILT_PATCH_H
#define RBVH_UNBUILT_PATCH_H
#include "kernels/trace/micro_quad.h"

// Sixteen vertices of row j, from column i on, in the space whose z axis is the ray.
static inline void sheared_row(const PatchTree* tree, const PreparedRay* q, uint i, uint j, float16* x,
                               float16* y) {
  // The arithmetic of patch_vertex().
  __global const Patch* p = tree->patch;
  const int level = (int)tree->level, n = 1 << level, shift = (int)p->level - level;
  const int16 lanes = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  int16 vi = min((int)i + lanes, (int16)(n)), vj = (int)j;
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

// Prefetches what sheared_row() reads.
static inline void prefetch_row(const PatchTree* tree, uint i, uint j) {
  __global const Patch* p = tree->patch;
  const uint shift = p->level - tree->level;
  ASK(tree->map + 3 * ((size_t)p->texels + (j << shift) * p->row + (i << shift)), 192u << shift);
}

// For patches of level 4 or more: visits the parts that the ray intersects, nearest first, and their
// micro-quads row by row, computing each row's vertices on the way. Returns micro-quads visited.
static uint intersect_unbuilt(const PatchTree* tree, const PreparedRay* q, uint parts, float16 parts_entry,
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
        prefetch_row(tree, i, min(j + 6, top + part_side));
        sheared_row(tree, q, i, j + 1, &x1, &y1);
        // Lane k: the edge from vertex k to k + 1, the one up from vertex k, and the diagonal.
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
#endif
