// Primitives (triangles or oriented discs) as the partition sees them: a box, an area and an area-weighted
// normal. After these kernels only the rasteriser distinguishes the two.
#include "kernels/build/load3.h"
#include "kernels/common/layout.h"

#pragma OPENCL FP_CONTRACT OFF

// Spreads the low 10 bits of x, two zeros between neighbours.
static inline uint spread(uint x) {
  x = (x | (x << 16)) & 0x030000ffu;
  x = (x | (x << 8)) & 0x0300f00fu;
  x = (x | (x << 4)) & 0x030c30c3u;
  return (x | (x << 2)) & 0x09249249u;
}

// 30-bit Morton codes of the primitives' centres. `vertices_each`: 3 (triangles, indices) or 1 (discs, no
// indices).
__kernel void primitives_morton(__global const float* positions, __global const uint* indices,
                                uint vertices_each, uint count, float4 lo, float4 scale, __global uint* codes,
                                __global uint* ids) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  float4 c;
  if (vertices_each == 3)
    c = (load3(positions, indices[3 * i]) + load3(positions, indices[3 * i + 1]) +
         load3(positions, indices[3 * i + 2])) *
        (1.0f / 3.0f);
  else
    c = load3(positions, i);
  const float4 cell = min(max((c - lo) * scale, 0.0f), 1023.0f);
  codes[i] = spread((uint)cell.x) | (spread((uint)cell.y) << 1) | (spread((uint)cell.z) << 2);
  ids[i] = i;
}

static inline uint scramble(uint x) {
  x = (x ^ (x >> 16)) * 0x85ebca6bu;
  x = (x ^ (x >> 13)) * 0xc2b2ae35u;
  return x ^ (x >> 16);
}

// Finds the vertices at boundary edges: inside a surface each neighbour of a vertex belongs to two of its
// triangles, and a number that is combined twice by exclusive or cancels. `left_over`: zero before; not zero
// after at a boundary vertex.
__kernel void primitives_boundary(__global const uint* indices, uint count,
                                  volatile __global uint* left_over) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const uint a = indices[3 * i], b = indices[3 * i + 1], c = indices[3 * i + 2];
  const uint of_a = scramble(a), of_b = scramble(b), of_c = scramble(c);
  atomic_xor(left_over + a, of_b ^ of_c);
  atomic_xor(left_over + b, of_c ^ of_a);
  atomic_xor(left_over + c, of_a ^ of_b);
}

// shape: 9 floats a triangle, its corners. box_lo.w: area. area_normal.w: 1 where it touches a boundary edge.
__kernel void primitives_triangles(__global const float* positions, __global const uint* indices,
                                   __global const uint* order, __global const uint* left_over, uint count,
                                   __global float* shape, __global float4* box_lo, __global float4* box_hi,
                                   __global float4* area_normal) {
  const uint j = get_global_id(0);
  if (j >= count) return;
  const uint i = order[j];
  const uint3 corner = vload3(i, indices);
  const float4 a = load3(positions, corner.x), b = load3(positions, corner.y), c = load3(positions, corner.z);
  vstore3(a.xyz, 0, shape + 9 * (size_t)j);
  vstore3(b.xyz, 1, shape + 9 * (size_t)j);
  vstore3(c.xyz, 2, shape + 9 * (size_t)j);
  float4 n = 0.5f * cross(b - a, c - a);
  float4 lo = min(a, min(b, c));
  lo.w = sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
  box_lo[j] = lo;
  box_hi[j] = max(a, max(b, c));
  n.w = (left_over[corner.x] | left_over[corner.y] | left_over[corner.z]) != 0 ? 1.0f : 0.0f;
  area_normal[j] = n;
}

// Of a disc's blend with others, in radii; and the cosine of normals that face the same way.
#define LEAST_REACH 1.8f
#define MOST_REACH 3.5f
#define REACH_PER_NOISE 10.0f
#define SAME_WAY 0.7f

// shape: centre, radius, unit normal, two unused. A disc stands for a square of its neighbours' spacing, so
// that a cloud's area does not count the discs' overlap: area = (radius * spacing_per_radius)^2.
__kernel void primitives_discs(__global const float* positions, __global const float* normals,
                               __global const float* radii, float spacing_per_radius,
                               __global const uint* order, uint count, __global float* shape,
                               __global float4* box_lo, __global float4* box_hi,
                               __global float4* area_normal) {
  const uint j = get_global_id(0);
  if (j >= count) return;
  const uint i = order[j];
  const float4 c = load3(positions, i), n = load3(normals, i);
  const float radius = radii[i];
  vstore3(c.xyz, 0, shape + 9 * (size_t)j);
  shape[9 * (size_t)j + 3] = radius;
  vstore3(n.xyz, 0, shape + 9 * (size_t)j + 4);
  shape[9 * (size_t)j + 7] = shape[9 * (size_t)j + 8] = 0.0f;
  // A disc extends radius * sqrt(1 - n_axis^2) along each axis.
  float4 extent = radius * sqrt(max(1.0f - n * n, 0.0f));
  extent.w = 0.0f;
  const float spacing = radius * spacing_per_radius;
  float4 lo = c - extent;
  lo.w = spacing * spacing;
  box_lo[j] = lo;
  box_hi[j] = c + extent;
  area_normal[j] = n * (spacing * spacing);
}

// How far each disc is blended with others, in its radii: the noisier a cloud is, the more of it a point must
// be averaged over. Noise is what is left of the distance between two neighbouring discs along their mean
// normal, which a smooth surface does not have (its bend is the same seen from both). One work-item handles
// `window` consecutive discs, each with those that follow it at once.
__kernel void primitives_reach(uint count, uint window, __global const float* shape, __global float* reach) {
  const uint begin = get_global_id(0) * window, end = min(begin + window, count);
  float noise = 0.0f, pairs = 0.0f;
  for (uint i = begin; i < end; ++i)
    for (uint j = i + 1; j < min(i + 4, end); ++j) {
      __global const float *a = shape + 9 * (size_t)i, *b = shape + 9 * (size_t)j;
      const float4 away = load3(b, 0) - load3(a, 0), na = (float4)(a[4], a[5], a[6], 0.0f),
                   nb = (float4)(b[4], b[5], b[6], 0.0f);
      const float radii = a[3] + b[3];
      if (!(dot(away, away) < radii * radii && dot(na, nb) > SAME_WAY)) continue;
      noise += fabs(dot(away, na + nb)) / radii;
      pairs += 1.0f;
    }
  const float r =
      clamp(LEAST_REACH + REACH_PER_NOISE * (pairs > 0.0f ? noise / pairs : 0.0f), LEAST_REACH, MOST_REACH);
  for (uint i = begin; i < end; ++i) reach[i] = r;
}

// A patch of fewer primitives than this is shape, not noise.
#define LEAST_PATCH 12u
// The area-weighted normals of a patch with one side sum up to more than this part of its area.
#define ONE_SIDED 0.35f

// The dominant axis of the normals of primitives [begin, end), whatever their signs: power iteration on the
// sum of n n^T / |n|, from its row of the largest diagonal entry.
static inline float4 main_axis(__global const float4* area_normal, uint begin, uint end) {
  float4 x = (float4)(0.0f), y = x, z = x;
  for (uint i = begin; i < end; ++i) {
    float4 n = area_normal[i];
    n.w = 0.0f;
    const float size = sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
    if (!(size > 0.0f)) continue;
    const float4 unit = n / size;
    x += n * unit.x;
    y += n * unit.y;
    z += n * unit.z;
  }
  float4 axis = x.x >= y.y && x.x >= z.z ? x : y.y >= z.z ? y : z;
  for (int iteration = 0; iteration < 4; ++iteration) {
    axis /= max(fabs(axis.x) + fabs(axis.y) + fabs(axis.z), 1e-37f);
    axis = (float4)(dot(x, axis), dot(y, axis), dot(z, axis), 0.0f);
  }
  return axis;
}

// Removes the area that noise finer than a patch of area `limit` adds: consecutive primitives of no more area
// than that are scaled to the area of their mean plane. Where normals cancel, as in a thin sheet, each side
// has a plane of its own. One work-item handles `window` consecutive primitives.
__kernel void primitives_smooth_areas(uint count, uint window, float limit,
                                      __global const float4* area_normal, __global float4* box_lo) {
  const uint first = get_global_id(0) * window, last = min(first + window, count);
  for (uint begin = first, end; begin < last; begin = end) {
    float area = box_lo[begin].w;
    for (end = begin + 1; end < last && area + box_lo[end].w <= limit; ++end) area += box_lo[end].w;
    if (end - begin < LEAST_PATCH || !(area > 0.0f)) continue;
    const float4 axis = main_axis(area_normal, begin, end);
    float4 sums[2] = {(float4)(0.0f), (float4)(0.0f)};
    for (uint i = begin; i < end; ++i) {
      float4 n = area_normal[i];
      n.w = 0.0f;
      sums[dot(n, axis) < 0.0f ? 1 : 0] += n;
    }
    const float one_side = length(sums[0] + sums[1]) / area;
    const float scale =
        one_side > ONE_SIDED ? min(one_side, 1.0f) : min((length(sums[0]) + length(sums[1])) / area, 1.0f);
    for (uint i = begin; i < end; ++i) box_lo[i].w *= scale;
  }
}
