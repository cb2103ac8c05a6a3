// One digit of a stable radix sort, one chunk of `length` pairs a work-item (pipeline/device/radix_sort.h).
// KEY: uint or ulong. DIGIT_BITS: log2 of the counters. Digit-major counters make their prefix sum the places
// where each chunk's keys of each digit go.
#define DIGITS (1u << DIGIT_BITS)

__kernel void radix_sort_count(__global const KEY* keys, uint count, uint length, uint chunks, uint shift,
                               uint mask, __global uint* counts) {
  const uint chunk = (uint)get_global_id(0);
  if (chunk >= chunks) return;
  const uint begin = chunk * length, end = begin + min(length, count - begin);
  uint seen[DIGITS];
  for (uint d = 0; d < DIGITS; ++d) seen[d] = 0;
  for (uint i = begin; i < end; ++i) ++seen[(uint)(keys[i] >> shift) & mask];
  for (uint d = 0; d < DIGITS; ++d) counts[d * chunks + chunk] = seen[d];
}

__kernel void radix_sort_scatter(__global const KEY* restrict keys, __global const uint* restrict values,
                                 uint count, uint length, uint chunks, uint shift, uint mask,
                                 __global const uint* restrict starts, __global KEY* restrict keys_out,
                                 __global uint* restrict values_out) {
  const uint chunk = (uint)get_global_id(0);
  if (chunk >= chunks) return;
  const uint begin = chunk * length, end = begin + min(length, count - begin);
  uint next[DIGITS];
  for (uint d = 0; d < DIGITS; ++d) next[d] = starts[d * chunks + chunk];
  for (uint i = begin; i < end; ++i) {
    const KEY key = keys[i];
    const uint to = next[(uint)(key >> shift) & mask]++;
    keys_out[to] = key;
    values_out[to] = values[i];
  }
}
