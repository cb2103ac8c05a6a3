// Morton codes of boxes' centres (pipeline/bvh/morton_order.h). KEY: uint (30 bits) or ulong (63 bits).
#pragma OPENCL FP_CONTRACT OFF
#include "kernels/bvh/boxes.h"

// Spreads the low 21 bits of x, two zeros between neighbours.
static inline ulong spread(ulong x) {
  x = (x | (x << 32)) & 0x001f00000000ffffUL;
  x = (x | (x << 16)) & 0x001f0000ff0000ffUL;
  x = (x | (x << 8)) & 0x100f00f00f00f00fUL;
  x = (x | (x << 4)) & 0x10c30c30c30c30c3UL;
  return (x | (x << 2)) & 0x1249249249249249UL;
}

// `lo`: the least centre; `scale`: cells a unit; `last`: the last cell along each axis. x is the highest bit.
__kernel void morton_order_codes(__global const float* boxes, __global const uint* indices, uint count,
                                 float4 lo, float4 scale, float last, __global KEY* codes) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  const float8 box = load_box(boxes, indices[i]);
  const float4 cell = min(max(((box.lo * 0.5f + box.hi * 0.5f) - lo) * scale, 0.0f), last);
  codes[i] = (KEY)(spread((ulong)cell.x) << 2 | spread((ulong)cell.y) << 1 | spread((ulong)cell.z));
}
