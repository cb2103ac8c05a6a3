// Checks of indices that come from data, for builds with -D RBVH_CHECK_BOUNDS; without it IN_BOUNDS is 1 and
// costs nothing. A kernel that takes part ends its arguments with BOUNDS_ARGUMENT. The host passes the sizes
// in bytes of the arguments before it, and throws an Error when the kernel reports a fault.
#ifndef RBVH_BOUNDS_H
#define RBVH_BOUNDS_H

#ifdef RBVH_CHECK_BOUNDS
// [0]: the line of the first fault, 0 for none; [1], [2]: the first element read and how many there are; from
// [3] on the name of the file, ended by a zero; [BOUNDS_HEADER + i]: the bytes of argument i.
typedef __global ulong* Bounds;
#define BOUNDS_FILE_BYTES 64
#define BOUNDS_HEADER (3 + BOUNDS_FILE_BYTES / 8)
#define BOUNDS_ARGUMENT , Bounds bounds
#define BOUNDS_MEMBER Bounds bounds;
#define BOUNDS_VALUE , bounds
// `buffer`: two words, the argument's number and the bytes of an element.
#define IN_BOUNDS(bounds, buffer, first, count) in_bounds(bounds, buffer, first, count, __FILE__, __LINE__)
#define LANES_IN_BOUNDS(bounds, buffer, first, lanes) \
  lanes_in_bounds(bounds, buffer, first, lanes, __FILE__, __LINE__)

static inline int in_bounds(Bounds bounds, uint argument, ulong element, ulong first, ulong count,
                            __constant const char* file, uint line) {
  const ulong there = bounds[BOUNDS_HEADER + argument] / element;
  if (first <= there && count <= there - first) return 1;
  if (atomic_cmpxchg((volatile __global uint*)bounds, 0u, line) == 0u) {
    bounds[1] = first;
    bounds[2] = there;
    __global char* name = (__global char*)(bounds + 3);
    for (uint i = 0; i + 1 < BOUNDS_FILE_BYTES && file[i] != 0; ++i) name[i] = file[i];
  }
  return 0;
}
static inline int lanes_in_bounds(Bounds bounds, uint argument, ulong element, ulong first, int16 lanes,
                                  __constant const char* file, uint line) {
  int lane[16];
  vstore16(lanes, 0, lane);
  for (uint i = 0; i < 16; ++i)
    if (!in_bounds(bounds, argument, element, first + (ulong)(long)lane[i], 1, file, line)) return 0;
  return 1;
}
#else
#define BOUNDS_ARGUMENT
#define BOUNDS_MEMBER
#define BOUNDS_VALUE
#define IN_BOUNDS(bounds, buffer, first, count) 1
#define LANES_IN_BOUNDS(bounds, buffer, first, lanes) 1
#endif
#endif
