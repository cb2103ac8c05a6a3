// Three packed floats as a float4.
#ifndef RBVH_LOAD3_H
#define RBVH_LOAD3_H

static inline float4 load3(__global const float* p, uint i) {
  return (float4)(p[3 * i], p[3 * i + 1], p[3 * i + 2], 0.0f);
}

#endif
