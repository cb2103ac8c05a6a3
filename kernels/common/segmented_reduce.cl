// Reduction over consecutive segments in an order that BLOCK alone fixes
// (pipeline/device/segmented_reduce.h).
//
//   blocks    |    0    |    1    |    2    |    3    |
//   segments  [a][ b       ][c][ d                ][e ]
//
// Whole segments within a block (a, c, e) are done at once. One that leaves its block (b, d) gets its first
// part as a preliminary result; every block it goes on into keeps that part in `heads` (b in 1; d in 2 and
// 3), and the block where it starts joins them in order.
#if COMPONENTS == 1
typedef float VALUE;
#elif COMPONENTS == 2
typedef float2 VALUE;
#elif COMPONENTS == 4
typedef float4 VALUE;
#else
typedef float8 VALUE;
#endif

#if REDUCTION == 0
#define IDENTITY 0.0f
#define REDUCE(a, b) ((a) + (b))
#elif REDUCTION == 1
#define IDENTITY INFINITY
#define REDUCE(a, b) select(a, b, (b) < (a))  // a NaN in b is skipped
#else
#define IDENTITY (-INFINITY)
#define REDUCE(a, b) select(a, b, (b) > (a))
#endif

static VALUE reduce_range(__global const VALUE* values, uint begin, uint end) {
  VALUE result = (VALUE)(IDENTITY);
  for (uint i = begin; i < end; ++i) {
    const VALUE value = values[i];
    result = REDUCE(result, value);
  }
  return result;
}

// The first of the segments + 1 offsets that is at least `position`; segments + 1 when there is none.
static uint first_start(__global const uint* offsets, uint segments, uint position) {
  uint low = 0, high = segments + 1;
  while (low < high) {
    const uint middle = low + (high - low) / 2;
    if (offsets[middle] < position) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low;
}

__kernel void segmented_reduce_blocks(__global const VALUE* values, uint blocks_per_item, uint blocks,
                                      __global const uint* offsets, uint segments, __global VALUE* heads,
                                      __global VALUE* out) {
  const uint first = (uint)get_global_id(0) * blocks_per_item;
  if (first >= blocks) return;
  const uint last = first + min(blocks_per_item, blocks - first);
  uint segment = first_start(offsets, segments, first * BLOCK);
  for (uint block = first; block < last; ++block) {
    const uint begin = block * BLOCK, end = begin + BLOCK;
    if (segment > 0 && segment <= segments)
      heads[block] = reduce_range(values, begin, min(end, offsets[segment]));
    for (; segment < segments && offsets[segment] < end; ++segment) {
      out[segment] = reduce_range(values, offsets[segment], min(end, offsets[segment + 1]));
    }
    if (segment == segments && offsets[segments] < end) ++segment;
  }
}

__kernel void segmented_reduce_join(uint blocks_per_item, uint blocks, __global const uint* offsets,
                                    uint segments, __global const VALUE* heads, __global VALUE* out) {
  const uint first = (uint)get_global_id(0) * blocks_per_item;
  if (first >= blocks) return;
  const uint last = first + min(blocks_per_item, blocks - first);
  for (uint block = first; block < last; ++block) {
    // Only the last segment that starts in a block can leave it.
    const uint after = first_start(offsets, segments, (block + 1) * BLOCK);
    if (after == 0 || after > segments) continue;
    const uint segment = after - 1, end = offsets[after];
    if (offsets[segment] < block * BLOCK) continue;
    VALUE result = out[segment];
    for (uint next = block + 1; next * BLOCK < end; ++next) {
      const VALUE head = heads[next];
      result = REDUCE(result, head);
    }
    out[segment] = result;
  }
}

// offsets[s]: the first of the ascending ids that is at least s. Every work-item writes the offsets of the
// numbers in (id before its element, id of its element]; beyond the last element those that remain.
__kernel void segmented_reduce_offsets(__global const uint* ids, uint count, uint length, uint segments,
                                       __global uint* offsets) {
  const uint begin = (uint)get_global_id(0) * length;
  if (begin > count) return;
  const uint end = begin + min(length, count + 1 - begin);
  uint next = begin == 0 ? 0 : ids[begin - 1] + 1;
  for (uint i = begin; i < end; ++i) {
    const uint id = i < count ? ids[i] : segments;
    for (; next <= id; ++next) offsets[next] = i;
  }
}
