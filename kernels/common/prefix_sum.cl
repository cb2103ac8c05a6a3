// Exclusive prefix sum, one chunk of `length` elements a work-item (pipeline/device/prefix_sum.h).

__kernel void prefix_sum_chunk_totals(__global const uint* in, uint count, uint length, uint chunks,
                                      __global uint* totals) {
  const uint chunk = (uint)get_global_id(0);
  if (chunk >= chunks) return;
  const uint begin = chunk * length, end = begin + min(length, count - begin);
  uint sum = 0;
  for (uint i = begin; i < end; ++i) sum += in[i];
  totals[chunk] = sum;
}

// `in` may be `out`: each element is read before it is written, by the same work-item. The last chunk adds
// the total.
__kernel void prefix_sum_chunks(__global const uint* in, uint count, uint length, uint chunks,
                                __global const uint* starts, __global uint* out) {
  const uint chunk = (uint)get_global_id(0);
  if (chunk >= chunks) return;
  const uint begin = chunk * length, end = begin + min(length, count - begin);
  uint sum = starts[chunk];
  for (uint i = begin; i < end; ++i) {
    const uint value = in[i];
    out[i] = sum;
    sum += value;
  }
  if (chunk == chunks - 1) out[count] = sum;
}
