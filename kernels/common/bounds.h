// Checks of the places that a kernel reads because data say so, for builds with -D RBVH_CHECK_BOUNDS; without
// it IN_BOUNDS is 1 and nothing else is left of them. A kernel that takes part ends its arguments with
// BOUNDS_ARGUMENT. The host fills that with the bytes of the arguments before it, and throws an Error when it
// comes back with a fault.
#ifndef RBVH_BOUNDS_H
#define RBVH_BOUNDS_H

#ifdef RBVH_CHECK_BOUNDS
// [0]: the line of the first fault, 0 for none; [1], [2]: the first element it wanted and how many there are;
// [3 + i]: the bytes of argument i.
typedef __global ulong* Bounds;
#define BOUNDS_ARGUMENT , Bounds bounds
#define BOUNDS_MEMBER Bounds bounds;
#define BOUNDS_VALUE , bounds
// `buffer`: two words, the argument's number and the bytes of an element.
#define IN_BOUNDS(bounds, buffer, first, count) in_bounds(bounds, buffer, first, count, __LINE__)
#define LANES_IN_BOUNDS(bounds, buffer, first, lanes) lanes_in_bounds(bounds, buffer, first, lanes, __LINE__)

static inline int in_bounds(Bounds bounds, uint argument, ulong element, ulong first, ulong count,
                            uint line) {
  const ulong there = bounds[3 + argument] / element;
  if (first <= there && count <= there - first) return 1;
  if (atomic_cmpxchg((volatile __global uint*)bounds, 0u, line) == 0u) {
    bounds[1] = first;
    bounds[2] = there;
  }
  return 0;
}
static inline int lanes_in_bounds(Bounds bounds, uint argument, ulong element, ulong first, int16 lanes,
                                  uint line) {
  int lane[16];
  vstore16(lanes, 0, lane);
  for (uint i = 0; i < 16; ++i)
    if (!in_bounds(bounds, argument, element, first + (ulong)(long)lane[i], 1, line)) return 0;
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
