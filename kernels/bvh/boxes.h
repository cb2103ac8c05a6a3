// Axis-aligned boxes in builders: lo.xyz, hi.xyz; s3 and s7 are free.
#ifndef RBVH_BOXES_H
#define RBVH_BOXES_H

// The i-th of a host's array of Bounds3f: six floats.
static inline float8 load_box(__global const float* boxes, uint i) {
  __global const float* b = boxes + 6 * (size_t)i;
  return (float8)(b[0], b[1], b[2], 0.0f, b[3], b[4], b[5], 0.0f);
}

static inline float8 box_union(float8 a, float8 b) { return (float8)(min(a.lo, b.lo), max(a.hi, b.hi)); }

static inline float box_half_area(float8 b) {
  const float4 e = b.hi - b.lo;
  return e.x * e.y + e.y * e.z + e.z * e.x;
}
#endif
