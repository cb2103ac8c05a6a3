// Groups of GROUP work-items that take jobs from a queue until none is left.
#ifndef RBVH_WORK_QUEUE_H
#define RBVH_WORK_QUEUE_H

// Runs `work` with `at` as the number of a job below `count`. `queue`: the next one's number, 0 at first.
#if GROUP > 1
#define GROUP_BARRIER barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)
#define TAKE_FROM_QUEUE(queue, count, ...)                  \
  __local uint taken;                                        \
  uint at;                                                   \
  do {                                                       \
    GROUP_BARRIER;                                           \
    if (get_local_id(0) == 0) taken = atomic_inc(queue);     \
    GROUP_BARRIER;                                           \
    at = taken;                                              \
    if (at < (count)) {                                      \
      __VA_ARGS__;                                             \
    }                                                        \
  } while (at < (count))
#else
#define GROUP_BARRIER
#define TAKE_FROM_QUEUE(queue, count, ...)                                                 \
  for (uint at = atomic_inc(queue); at < (count); at = atomic_inc(queue)) {                 \
    __VA_ARGS__;                                                                              \
  }
#endif
#endif
