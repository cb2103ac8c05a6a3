// What device_test.cpp asks of a device. Names with ; [brackets] "quotes" and \ in comments must not hurt.
#include "probe_include.h"

__kernel void probe_add(__global const uint* in, uint add, __global uint* out, uint count) {
  const uint i = (uint)get_global_id(0);
  if (i < count) out[i] = in[i] + add + PROBE_INCLUDED;
}

__kernel void probe_alignment(__global const uchar* a, __global uint* out) {
  out[0] = (uint)((size_t)a & 63u);
}

__kernel void probe_null(__global const uint* maybe, __global uint* out) { out[0] = maybe ? 1u : 2u; }

#ifdef PROBE_SLOW
__kernel void probe_slow(__global float* a) {
  float x = a[get_global_id(0)];
#pragma unroll
  for (int i = 0; i < 30; ++i) x = pow(sin(x), cos(x)) + exp(tan(x)) + log(x) + atan2(x, PROBE_SLOW);
  a[get_global_id(0)] = x;
}
#endif
