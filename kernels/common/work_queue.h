// Groups of GROUP work-items take jobs until none is left.
#ifndef RBVH_WORK_QUEUE_H
#define RBVH_WORK_QUEUE_H

// Runs `...` with `at` as the number of a job below `count`. On a CPU a group is one work-item and takes
// numbers from `queue`, which starts at 0. On a GPU there are as many groups as jobs, and the device's
// scheduler is the queue: PoCL loses jobs where a group takes its next job between barriers.
#if GROUP > 1
#define GROUP_BARRIER barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)
#define TAKE_FROM_QUEUE(queue, count, ...) \
  {                                        \
    const uint at = (uint)get_group_id(0); \
    __VA_ARGS__;                           \
  }
#else
#define GROUP_BARRIER
#define TAKE_FROM_QUEUE(queue, count, ...)                                  \
  for (uint at = atomic_inc(queue); at < (count); at = atomic_inc(queue)) { \
    __VA_ARGS__;                                                            \
  }
#endif
#endif
