// A loop of `iterations` steps that no compiler can shorten: a linear congruential generator, each number
// made of the one before (pipeline/device/check_loops.h).
// Part of every program.

__kernel void check_loops(uint iterations, __global uint* out) {
  if (get_global_id(0) != 0) return;
  uint done = 0, number = 0;
  for (; done < iterations; ++done) number = number * 1664525u + 1013904223u;
  out[0] = done;
  out[1] = number;
}
