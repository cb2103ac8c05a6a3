// Finds a tile's overlapping neighbours, primitives of other tiles whose box overlaps its box, by traversing
// the partition.
#include "kernels/common/layout.h"

#define STACK 128

static inline bool boxes_overlap(float4 lo, float4 hi, float4 other_lo, float4 other_hi) {
  return all(lo.xyz <= other_hi.xyz) && all(other_lo.xyz <= hi.xyz);
}

// Counts them (`write` 0), or writes them from firsts[k] on, in the partition's order.
__kernel void overlaps_find(__global const PartitionBox* nodes, __global const OverlapQuery* queries,
                            uint query_count, __global const uint* references, __global const float4* box_lo,
                            __global const float4* box_hi, uint write, __global uint* counts,
                            __global const uint* firsts, __global uint* overlaps) {
  const uint k = get_global_id(0);
  if (k >= query_count) return;
  const OverlapQuery query = queries[k];
  const float4 lo = (float4)(vload3(0, query.lo), 0.0f), hi = (float4)(vload3(0, query.hi), 0.0f);
  uint count = 0;
  int stack[STACK];
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    __global const PartitionBox* node = nodes + stack[--top];
    if (node->begin >= query.begin && node->end <= query.end) continue;
    if (!boxes_overlap(lo, hi, (float4)(vload3(0, node->lo), 0.0f), (float4)(vload3(0, node->hi), 0.0f)))
      continue;
    // Where the stack is full, the whole subtree is tested primitive by primitive.
    if (node->left >= 0 && top + 2 <= STACK) {
      stack[top++] = node->left + 1;
      stack[top++] = node->left;
      continue;
    }
    for (uint i = node->begin; i < node->end; ++i) {
      if (i >= query.begin && i < query.end) continue;
      const uint j = references[i];
      if (!boxes_overlap(lo, hi, box_lo[j], box_hi[j])) continue;
      if (write) overlaps[firsts[k] + count] = j;
      ++count;
    }
  }
  if (!write) counts[k] = count;
}
